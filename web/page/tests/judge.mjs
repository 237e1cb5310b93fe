// Reads an MCAP file with the format's own library and its ROS 2 messages with Foxglove's, and
// prints what is in it. Fails when index and stream disagree or anything is not as the format has it.
import { open } from "node:fs/promises";
import { readFileSync } from "node:fs";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";

const path = process.argv[2];

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

const { reader, messages, metadata } = await readIndexed();
const { counts, types } = readStream();
if (metadata !== 1) throw new Error("no scene among the metadata");
if (types.Chunk !== reader.chunkIndexes.length) throw new Error("chunks and their index differ");

const last = new Map();
for (const [id, channel] of reader.channelsById) {
  const schema = reader.schemasById.get(channel.schemaId);
  const text = new TextDecoder().decode(schema.data);
  const decoder = new MessageReader(parse(text, { ros2: true }));
  const own = messages.filter((message) => message.channelId === id);
  const counted = Number(reader.statistics.channelMessageCounts.get(id));
  if (own.length !== counts.get(id) || own.length !== counted)
    throw new Error(`${channel.topic}: index ${own.length}, stream ${counts.get(id)}, statistics ${counted}`);
  for (const message of own) last.set(schema.name, decoder.readMessage(message.data));
  console.log(channel.topic, schema.name, own.length);
}
for (let i = 1; i < messages.length; ++i)
  if (messages[i].logTime < messages[i - 1].logTime) throw new Error("messages out of order");

const tick = last.get("clamber/msg/Tick");
console.log("last tick", String(tick.sequence), tick.tau_meas[tick.tau_meas.length - 1]);
const state = last.get("sensor_msgs/msg/JointState");
console.log("last joint state", state.header.stamp.sec + state.header.stamp.nsec * 1e-9, state.name.at(-1));
const tf = last.get("tf2_msgs/msg/TFMessage");
if (tf)
  console.log("last transforms", tf.transforms.length, tf.transforms[0].header.frame_id, tf.transforms[0].child_frame_id);
