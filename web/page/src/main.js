// The page of `clamber web` and of climb.html. Where the run comes from: the page itself, else
// ?file=, else the server's live data; a dropped .mcap replaces it.
import "./style.css";
import { JointList } from "./joint_list.js";
import { listen } from "./live.js";
import { openMcap } from "./open_mcap.js";
import { RobotView } from "./robot_view.js";
import { Run, floatsOfBase64 } from "./run.js";
import { Timeline } from "./timeline.js";
import { TorquePlot } from "./torque_plot.js";

const byId = (id) => document.getElementById(id);
const PLOT_PERIOD = 250; // ms between two redraws of plots while live

class Page {
  constructor() {
    this.view = new RobotView(byId("scene"));
    this.plot = new TorquePlot(byId("plot"), (time) => this.seek(time));
    this.timeline = new Timeline(byId("timeline"), (time) => this.seek(time));
    this.joints = new JointList(byId("joints"), (chosen) => this.plot.choose(this.run, chosen));
    this.time = 0;
    this.following = false;
    this.playing = false;
    byId("play").addEventListener("click", () => this.play(!this.playing));
    byId("live").addEventListener("click", () => this.follow());
    byId("scrub").addEventListener("input", (event) => this.seek(Number(event.target.value)));
    byId("file").addEventListener("change", (event) => this.openFile(event.target.files[0]));
    addEventListener("keydown", (event) => this.key(event));
    this.acceptDrops();
  }

  acceptDrops() {
    addEventListener("dragover", (event) => {
      event.preventDefault();
      document.body.classList.add("dragging");
    });
    addEventListener("dragleave", (event) => {
      if (!event.relatedTarget) document.body.classList.remove("dragging");
    });
    addEventListener("drop", (event) => {
      event.preventDefault();
      document.body.classList.remove("dragging");
      if (event.dataTransfer.files.length > 0) this.openFile(event.dataTransfer.files[0]);
    });
  }

  key(event) {
    if (["INPUT", "SELECT", "BUTTON"].includes(event.target.tagName)) return;
    if (event.key === " ") this.play(!this.playing);
    else if (event.key === "ArrowLeft") this.seek(this.time - 0.1);
    else if (event.key === "ArrowRight") this.seek(this.time + 0.1);
    else return;
    event.preventDefault();
  }

  note(text, bad = false) {
    byId("status").textContent = text;
    byId("status").classList.toggle("bad", bad);
  }

  badge(text, kind = "") {
    byId("source").textContent = text;
    byId("source").className = `badge ${kind}`;
  }

  /** Shows a run from its start; rows may still come. */
  load(run) {
    this.run = run;
    this.play(false);
    this.view.load(run.scene);
    this.joints.load(run);
    this.plot.choose(run, this.joints.chosen);
    this.timeline.load(run);
    this.grown();
    this.seek(run.start);
  }

  grown() {
    const scrub = byId("scrub");
    scrub.min = this.run.start;
    scrub.max = this.run.end;
    document.body.dataset.rows = this.run.rows;
  }

  seek(time) {
    this.following = false;
    byId("live").classList.remove("on");
    this.show(time);
  }

  show(time) {
    const { run } = this;
    if (!run || run.rows === 0) return;
    this.time = Math.min(run.end, Math.max(run.start, time));
    const row = run.rowAt(this.time);
    this.view.show(run, row);
    this.joints.show(row);
    this.plot.showTime(this.time);
    this.timeline.showTime(this.time);
    byId("scrub").value = this.time;
    byId("time").value = `${run.time(row).toFixed(2)} s`;
    byId("phase").value = run.phaseName(row);
    byId("mode").value = run.modeName(row);
    byId("fault").value = run.faultText(row);
    const event = run.eventAt(this.time);
    byId("event").value = byId("event").title = event ? run.eventText(event) : "";
    byId("carried").value = `${run.sum(row, "force_obstacle").toFixed(0)} N`;
    byId("floor").value = `${run.sum(row, "force_floor").toFixed(0)} N`;
    const worst = run.worstJoint(row);
    if (worst < 0) return;
    const { name, limit } = run.scene.joints[worst];
    byId("worst").value = `${name} ${run.torque(row, worst).toFixed(1)} of ${limit.toFixed(0)} N m`;
  }

  play(on) {
    this.playing = on;
    byId("play").textContent = on ? "⏸" : "▶";
    if (!on) return;
    if (this.run && this.time >= this.run.end - 1e-3) this.seek(this.run.start);
    let before = performance.now();
    const step = (now) => {
      if (!this.playing) return;
      const passed = ((now - before) / 1000) * Number(byId("speed").value);
      before = now;
      this.seek(this.time + passed);
      if (this.time >= this.run.end) this.play(false);
      else requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  follow() {
    this.play(false);
    this.following = true;
    if (this.run) this.show(this.run.end);
  }

  async openFile(blob, name = blob.name) {
    this.note(`reading ${name} ...`);
    try {
      const { run, cut } = await openMcap(blob);
      this.source = "file";
      byId("live").hidden = true;
      this.badge(name);
      this.note(cut ? "the recording's end is missing: shown up to its last complete second" : "");
      this.load(run);
    } catch (error) {
      this.note(`${name}: ${error.message}`, true);
    }
  }

  listenLive() {
    this.source = "live";
    byId("live").hidden = false;
    const ifLive = (work) => (...given) => this.source === "live" && work(...given);
    listen({
      run: ifLive((run) => {
        this.load(run);
        this.follow();
        this.badge("waiting for the robot");
      }),
      rows: ifLive((run) => {
        this.badge("live", "live");
        this.grown();
        this.redrawPlots();
        if (this.following) this.show(run.end);
      }),
      story: ifLive((run) => {
        this.redrawPlots();
        this.show(this.following ? run.end : this.time);
      }),
      lost: ifLive(() => this.badge("connection lost, trying again", "lost")),
      note: ifLive((text) => this.note(text)),
    });
  }

  redrawPlots() {
    if (this.redrawing) return;
    this.redrawing = true;
    setTimeout(() => {
      this.redrawing = false;
      this.plot.refresh();
      this.joints.sort();
      this.timeline.redraw();
    }, PLOT_PERIOD);
  }
}

async function start() {
  const page = new Page();
  const embedded = byId("run");
  if (embedded) {
    const { name, scene, story, layout, rows } = JSON.parse(embedded.textContent);
    const run = new Run(scene, layout, story);
    run.append(floatsOfBase64(rows));
    page.badge(name);
    page.load(run);
    return;
  }
  const file = new URLSearchParams(location.search).get("file");
  if (file === null) {
    page.listenLive();
    return;
  }
  // Of this server only: a link must not make the page fetch from elsewhere.
  const address = new URL(file, location.href);
  if (address.origin !== location.origin) {
    page.note(`${file}: only files of this server are opened`, true);
    return;
  }
  const answer = await fetch(address);
  if (answer.ok) await page.openFile(await answer.blob(), file);
  else page.note(`${file}: ${answer.status} ${answer.statusText}`, true);
}

start();
