// Reads a recording of `clamber record` or `clamber export` into a Run, up to its last complete
// chunk where it was cut.
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import { McapStreamReader } from "@mcap/core";
import { Run } from "./run.js";

const PERIOD = 0.02; // s: what a row stands for, as in web/view_rows.cpp
const PIECE = 4 << 20; // bytes given to the reader at a time

function layoutFor(joints, contacts) {
  return [
    ["time", 1], ["plan_time", 1], ["phase", 1], ["mode", 1], ["fault", 1], ["fault_joint", 1], ["base", 7], ["q", joints], ["tau_low", joints],
    ["tau_high", joints], ["force_obstacle", contacts], ["force_floor", contacts],
  ];
}

/** Rows out of ticks: the last of each period, with the lowest and highest torques in it. */
class RowMaker {
  constructor(run) {
    this.run = run;
    this.row = new Float32Array(run.width);
    this.period = -1;
    this.place = run.at;
  }
  add(tick) {
    const period = Math.floor(tick.time / PERIOD + 1e-6);
    const first = period !== this.period;
    if (first) this.finish();
    this.period = period;
    const { row, place } = this;
    row[place.time] = tick.time;
    row[place.plan_time] = tick.plan_time;
    for (const name of ["phase", "mode", "fault", "fault_joint"]) row[place[name]] = tick[name];
    const truth = (tick.flags & 1) !== 0;
    row.set(truth ? tick.base_position : [0, 0, 0.5], place.base);
    row.set(truth ? tick.base_orientation : [1, 0, 0, 0], place.base + 3);
    row.set(tick.q, place.q);
    row.set(tick.force_obstacle, place.force_obstacle);
    row.set(tick.force_floor, place.force_floor);
    tick.tau_meas.forEach((torque, j) => {
      const low = place.tau_low + j;
      const high = place.tau_high + j;
      row[low] = first ? torque : Math.min(row[low], torque);
      row[high] = first ? torque : Math.max(row[high], torque);
    });
  }
  finish() {
    if (this.period >= 0) this.run.append(this.row);
  }
}

/** Hands every record of the file to `take`. @returns whether the file is cut */
async function readRecords(blob, take) {
  const reader = new McapStreamReader();
  for (let at = 0; at < blob.size; at += PIECE) {
    reader.append(new Uint8Array(await blob.slice(at, at + PIECE).arrayBuffer()));
    for (let record; (record = reader.nextRecord()); ) take(record);
  }
  return !reader.done();
}

/** @returns {Promise<{run: Run, cut: boolean}>} @throws Error that says what is wrong */
export async function openMcap(blob) {
  const schemas = new Map();
  const channels = new Map();
  const story = { phases: [], modes: [], faults: [], events: [] };
  let scene;
  let run;
  let rows;
  const messages = {
    "clamber/msg/Tick": (tick) => {
      if (!scene) throw new Error("the recording says nothing of the robot's shape");
      run ??= new Run(scene, layoutFor(tick.q.length, tick.force_obstacle.length), story);
      rows ??= new RowMaker(run);
      rows.add(tick);
    },
    "clamber/msg/Description": ({ phases, modes, faults }) =>
      Object.assign(story, { phases: phases.map((phase) => phase.name), modes, faults }),
    "clamber/msg/Event": (event) => story.events.push(event),
  };
  const records = {
    Metadata: (record) => {
      if (record.name === "clamber") scene = JSON.parse(record.metadata.get("scene") ?? "null");
    },
    Schema: (record) => schemas.set(record.id, record),
    Channel: (record) => {
      const schema = schemas.get(record.schemaId);
      const take = messages[schema?.name];
      if (!take) return;
      const decoder = new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true }));
      channels.set(record.id, (data) => take(decoder.readMessage(data)));
    },
    Message: (record) => channels.get(record.channelId)?.(record.data),
  };
  const cut = await readRecords(blob, (record) => records[record.type]?.(record));
  if (!run) throw new Error("the file holds no run of Clamber");
  rows.finish();
  return { run, cut };
}
