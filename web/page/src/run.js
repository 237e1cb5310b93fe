// A run as the page holds it: one row of numbers for every 20 ms, in which torques keep their lowest
// and highest value, so that no peak is lost. The rows come from the server, the page or an .mcap.

/** How long a live run is kept, in rows. */
const MOST_ROWS = 30000;

const NO_STORY = { phases: [], modes: [], faults: [], events: [] };
const KINDS = ["mode", "fault", "phase", "plan", "telemetry"];

/** Names and lengths of a row's parts -> where each begins. */
function places(layout) {
  const at = {};
  let width = 0;
  for (const [name, size] of layout) {
    at[name] = width;
    width += size;
  }
  return { at, width };
}

export function floatsOfBase64(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Float32Array(bytes.buffer);
}

export class Run {
  /**
   * @param scene robot, obstacle: see report/scene_json.hpp
   * @param layout [[name, length], ...] of a row: see web/view_rows.hpp
   * @param story names and events: see web/story.hpp
   */
  constructor(scene, layout, story = NO_STORY) {
    this.scene = scene;
    this.story = story;
    this.layout = layout;
    ({ at: this.at, width: this.width } = places(layout));
    this.sizes = Object.fromEntries(layout);
    this.clear();
  }

  clear() {
    this.data = new Float32Array(this.width * 1024);
    this.rows = 0;
    this.segments = []; // {value, from, to}: rows of one phase
    this.faults = []; // likewise; 0: none
    this.peaks = new Float32Array(this.sizes.q); // N m, largest magnitude per joint
    this.changed = 0; // counts what cannot be drawn by adding
  }

  /** Adds whole rows. A run that starts anew, seen by time stepping back, replaces the old one. */
  append(numbers) {
    for (let i = 0; i + this.width <= numbers.length; i += this.width) {
      const row = numbers.subarray(i, i + this.width);
      if (this.rows > 0 && row[this.at.time] < this.time(this.rows - 1)) this.clear();
      if (this.rows >= MOST_ROWS) this.forgetOldest();
      this.makeRoom();
      this.data.set(row, this.rows * this.width);
      this.rows += 1;
      this.takeIn(this.rows - 1);
    }
  }

  makeRoom() {
    if ((this.rows + 1) * this.width <= this.data.length) return;
    const larger = new Float32Array(this.data.length * 2);
    larger.set(this.data);
    this.data = larger;
  }

  forgetOldest() {
    const keep = Math.floor(this.rows / 2);
    const kept = this.data.slice((this.rows - keep) * this.width, this.rows * this.width);
    const changed = this.changed + 1;
    this.clear();
    this.changed = changed;
    this.append(kept);
  }

  takeIn(row) {
    this.extend(this.segments, row, this.value(row, "phase"));
    this.extend(this.faults, row, this.value(row, "fault"));
    for (let j = 0; j < this.sizes.q; ++j)
      this.peaks[j] = Math.max(this.peaks[j], this.torque(row, j));
  }

  extend(segments, row, value) {
    const last = segments.at(-1);
    if (last?.value === value) last.to = row;
    else segments.push({ value, from: row, to: row });
  }

  value(row, name, i = 0) {
    return this.data[row * this.width + this.at[name] + i];
  }
  time(row) {
    return this.value(row, "time");
  }
  /** Largest magnitude of joint j in the row, N m. */
  torque(row, j) {
    return Math.max(-this.value(row, "tau_low", j), this.value(row, "tau_high", j));
  }
  /** The last row that is not later than `time`. */
  rowAt(time) {
    let low = 0;
    let high = this.rows - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.time(middle) <= time + 1e-4) low = middle;
      else high = middle - 1;
    }
    return Math.max(0, low);
  }
  get start() {
    return this.rows > 0 ? this.time(0) : 0;
  }
  get end() {
    return this.rows > 0 ? this.time(this.rows - 1) : 0;
  }
  phaseName(row) {
    const index = this.value(row, "phase");
    return this.story.phases[index] ?? `phase ${index}`;
  }
  modeName(row) {
    const index = this.value(row, "mode");
    return this.story.modes[index] ?? `mode ${index}`;
  }
  /** Which fault stands and where it was seen; "": none. */
  faultText(row) {
    const index = this.value(row, "fault");
    if (index === 0) return "";
    return (this.story.faults[index] ?? `fault ${index}`) + this.atJoint(this.value(row, "fault_joint"));
  }
  eventText({ time, kind, joint, text }) {
    return `${time.toFixed(2)} s ${KINDS[kind] ?? "event"}: ${text}${this.atJoint(joint)}`;
  }
  /** The last event that is not later than `time`. */
  eventAt(time) {
    return this.story.events.findLast((event) => event.time <= time + 1e-4);
  }
  atJoint(joint) {
    const name = this.scene.joints[joint]?.name;
    return name ? ` at ${name}` : "";
  }
  sum(row, name) {
    let total = 0;
    for (let i = 0; i < this.sizes[name]; ++i) total += this.value(row, name, i);
    return total;
  }
  /** The joint with the least margin in the row, or -1 when no limit is known. */
  worstJoint(row) {
    let worst = -1;
    let load = -1;
    this.scene.joints.forEach((joint, j) => {
      const own = joint.limit > 0 ? this.torque(row, j) / joint.limit : -1;
      if (own > load) [worst, load] = [j, own];
    });
    return worst;
  }
}
