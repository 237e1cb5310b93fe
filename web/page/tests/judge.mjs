// Judges a recording with the libraries that Foxglove itself opens files with. Reads it by its index
// and as a stream, checksums on; holds ROS 2's own types against ROS 2's definitions; decodes every
// message, and encodes it again to the same bytes; compares every tick with the CSV of the same run.
// Usage: judge.mjs RUN.mcap RUN.csv
import assert from "node:assert/strict";
import { open } from "node:fs/promises";
import { readFileSync } from "node:fs";
import { parse } from "@foxglove/rosmsg";
import { ros2jazzy } from "@foxglove/rosmsg-msgs-common";
import { MessageReader, MessageWriter } from "@foxglove/rosmsg2-serialization";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";

const [path, table] = process.argv.slice(2);

class FileHandleReadable {
  constructor(handle) {
    this.handle = handle;
  }
  async size() {
    return BigInt((await this.handle.stat()).size);
  }
  async read(offset, length) {
    const buffer = new Uint8Array(Number(length));
    await this.handle.read(buffer, 0, Number(length), Number(offset));
    return buffer;
  }
}

async function readIndexed() {
  const handle = await open(path);
  const reader = await McapIndexedReader.Initialize({ readable: new FileHandleReadable(handle) });
  const messages = [];
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    messages.push({ ...message, data: message.data.slice() });
  }
  let metadata = 0;
  for await (const record of reader.readMetadata()) {
    if (record.name === "clamber" && record.metadata.has("scene")) metadata += 1;
  }
  await handle.close();
  return { reader, messages, metadata };
}

function readStream() {
  const reader = new McapStreamReader({ validateCrcs: true, includeChunks: true });
  reader.append(readFileSync(path));
  const counts = new Map();
  const types = {};
  for (let record; (record = reader.nextRecord()); ) {
    types[record.type] = (types[record.type] ?? 0) + 1;
    if (record.type === "Message")
      counts.set(record.channelId, (counts.get(record.channelId) ?? 0) + 1);
  }
  if (!reader.done()) throw new Error("the stream does not end with the format's last bytes");
  return { counts, types };
}

/** Without types of numbers and arrays, and without what is undefined. */
function simple(value) {
  const plain = (_, each) =>
    typeof each === "bigint" ? Number(each) : ArrayBuffer.isView(each) ? [...each] : each;
  return JSON.parse(JSON.stringify(value, plain));
}

/** @returns whether the type and those that it is made of are ROS 2's; throws where they differ */
function isOfRos(name, definitions) {
  if (name.startsWith("clamber/")) return false;
  for (const { name: part, definitions: fields } of definitions) {
    const official = ros2jazzy[part ?? name.replace("/msg/", "/")];
    assert.deepEqual(simple(fields), simple(official?.definitions ?? {}), part ?? name);
  }
  return true;
}

/** Lines of numbers under names like "q.LKneeSag [rad]". */
function compareWithTable(ticks) {
  const [names, ...lines] = readFileSync(table, "utf8").trimEnd().split("\n");
  const columns = names.split(",").map((name) => name.match(/^[^. ]+/)[0]);
  assert.equal(ticks.length, lines.length);
  ticks.forEach((tick, i) => {
    const numbers = lines[i].split(",").map(Number);
    const fields = Object.entries(simple(tick));
    const flat = fields.flatMap(([name, value]) => [value].flat().map((each) => [name, each]));
    assert.deepEqual(flat.map(([name]) => name), columns);
    assert.deepEqual(flat.map(([, value]) => value), numbers, `tick ${tick.sequence}`);
  });
  console.log(`ticks as in the table: ${ticks.length} of ${columns.length} numbers`);
}

const { reader, messages, metadata } = await readIndexed();
const { counts, types } = readStream();
assert.equal(metadata, 1, "no scene among the metadata");
assert.equal(types.Chunk, reader.chunkIndexes.length, "chunks and their index differ");
for (let i = 1; i < messages.length; ++i)
  assert.ok(messages[i].logTime >= messages[i - 1].logTime, "messages out of order");

const decoded = new Map();
for (const [id, channel] of reader.channelsById) {
  const schema = reader.schemasById.get(channel.schemaId);
  const definitions = parse(new TextDecoder().decode(schema.data), { ros2: true });
  const decoder = new MessageReader(definitions);
  const encoder = new MessageWriter(definitions);
  const own = messages.filter((message) => message.channelId === id);
  const counted = Number(reader.statistics.channelMessageCounts.get(id));
  assert.deepEqual([counts.get(id), counted], [own.length, own.length], `${channel.topic}: counts`);
  const values = own.map(({ data }) => {
    const value = decoder.readMessage(data);
    assert.ok(Buffer.from(encoder.writeMessage(value)).equals(data), `${channel.topic}: other bytes`);
    return value;
  });
  decoded.set(schema.name, { values, definitions });
  const official = isOfRos(schema.name, definitions) ? ", as in ROS 2" : "";
  console.log(`${channel.topic} ${schema.name} ${own.length}${official}`);
}
compareWithTable(decoded.get("clamber/msg/Tick").values);

/** As Foxglove names a number: by the constants before its field. */
function nameOf(type, field, value) {
  const { definitions } = decoded.get(type).definitions.find(({ name }) => name === undefined);
  const at = definitions.findIndex(({ name }) => name === field);
  let from = at;
  while (from > 0 && definitions[from - 1].isConstant) from -= 1;
  return definitions.slice(from, at).find((each) => each.value === value)?.name;
}

const last = (type) => decoded.get(type).values.at(-1);
const state = last("sensor_msgs/msg/JointState");
console.log("last joint state", state.header.stamp.sec + state.header.stamp.nsec * 1e-9, state.name.at(-1));
const tf = last("tf2_msgs/msg/TFMessage");
console.log("last transforms", tf.transforms.length, tf.transforms[0].header.frame_id, tf.transforms[0].child_frame_id);
const event = last("clamber/msg/Event");
const named = (field) => `${field} ${event[field]} ${nameOf("clamber/msg/Event", field, event[field])}`;
console.log(`last event ${event.number} ${event.time.toFixed(1)} ${named("kind")} ${named("severity")} joint ${event.joint}: ${event.text}`);
const names = last("clamber/msg/Description");
console.log(`phases ${names.phases.map(({ name }) => name)} modes ${names.modes} faults ${names.faults}`);
console.log("urdf", last("std_msgs/msg/String").data);
