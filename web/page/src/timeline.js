// Events and faults over time and, below them, the plan's phases and which contact link carries what.
const EVENT_HEIGHT = 13;
const PHASE_HEIGHT = 20;
const ROW = 9;
const LEFT = 56; // for the links' names
const CARRIES = 2; // N
const NEAR = 4; // pixels, of the pointer
const EVENTS = ["#66717f", "#dd9a2b", "#c22f2f"]; // by severity
const FAULT = "#f3c4c4";
const PHASES = { swing: "#f2c38b", other: "#a9c4ea", unknown: "#d5dbe3" };

export class Timeline {
  constructor(canvas, seek) {
    this.canvas = canvas;
    this.time = 0;
    const pick = (event) => {
      if (!this.run || this.run.rows === 0) return;
      const share = (event.offsetX - LEFT) / (canvas.clientWidth - LEFT);
      seek(this.run.start + Math.min(1, Math.max(0, share)) * (this.run.end - this.run.start));
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      pick(event);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons & 1) pick(event);
      this.explain(event);
    });
    new ResizeObserver(() => this.redraw()).observe(canvas.parentElement);
  }

  /** The phase under the pointer, in full, for names are longer than their strips; and events. */
  explain({ offsetX }) {
    const { run } = this;
    if (!run || run.rows === 0) return;
    const { clientWidth: width } = this.canvas;
    const time = run.start + ((offsetX - LEFT) / (width - LEFT)) * (run.end - run.start);
    const events = run.story.events.filter((event) => Math.abs(this.x(event.time, width) - offsetX) <= NEAR);
    const texts = events.map((event) => run.eventText(event));
    this.canvas.title = [run.phaseName(run.rowAt(time)), ...texts].join("\n");
  }

  load(run) {
    this.run = run;
    this.canvas.style.height = `${EVENT_HEIGHT + PHASE_HEIGHT + run.scene.contacts.length * ROW + 6}px`;
    this.redraw();
  }

  /** Draws everything but the time on a canvas of its own, which is kept. */
  redraw() {
    if (!this.run) return;
    const scale = window.devicePixelRatio;
    const { clientWidth: width, clientHeight: height } = this.canvas;
    this.canvas.width = width * scale;
    this.canvas.height = height * scale;
    this.still = document.createElement("canvas");
    this.still.width = this.canvas.width;
    this.still.height = this.canvas.height;
    const paint = this.still.getContext("2d");
    paint.scale(scale, scale);
    paint.font = "11px system-ui, sans-serif";
    if (this.run.rows > 0) {
      this.drawEvents(paint, width);
      paint.translate(0, EVENT_HEIGHT);
      this.drawPhases(paint, width);
      this.run.scene.contacts.forEach((contact, c) => this.drawContact(paint, contact, c, width));
    }
    this.showTime(this.time);
  }

  x(time, width) {
    const { start, end } = this.run;
    return LEFT + ((time - start) / Math.max(end - start, 1e-6)) * (width - LEFT);
  }

  /** A band where a fault stands, a mark for every event; of two at one place the graver. */
  drawEvents(paint, width) {
    const { run } = this;
    paint.fillStyle = FAULT;
    for (const { value, from, to } of run.faults) {
      if (value === 0) continue;
      const left = this.x(run.time(from), width);
      paint.fillRect(left, 1, Math.max(this.x(run.time(to), width) - left, 2), EVENT_HEIGHT - 2);
    }
    const shown = run.story.events.filter(({ time }) => time >= run.start && time <= run.end);
    for (const { time, severity } of shown.sort((a, b) => a.severity - b.severity)) {
      paint.fillStyle = EVENTS[severity] ?? EVENTS[0];
      paint.fillRect(this.x(time, width) - 1, 2, severity > 0 ? 3 : 2, EVENT_HEIGHT - 4);
    }
    paint.fillStyle = "#66717f";
    paint.fillText("event", 4, EVENT_HEIGHT - 3);
  }

  drawPhases(paint, width) {
    const { run } = this;
    for (const { from, to } of run.segments) {
      const name = run.phaseName(from);
      const left = this.x(run.time(from), width);
      const right = this.x(run.time(Math.min(to + 1, run.rows - 1)), width);
      paint.fillStyle = name.startsWith("swing")
        ? PHASES.swing
        : run.story.phases.length
          ? PHASES.other
          : PHASES.unknown;
      paint.fillRect(left, 2, Math.max(right - left - 1, 1), PHASE_HEIGHT - 4);
      if (paint.measureText(name).width < right - left - 4) {
        paint.fillStyle = "#1e2732";
        paint.fillText(name, left + 3, PHASE_HEIGHT - 7);
      }
    }
    paint.fillStyle = "#66717f";
    paint.fillText("phase", 4, PHASE_HEIGHT - 7);
  }

  drawContact(paint, contact, c, width) {
    const { run } = this;
    const top = PHASE_HEIGHT + c * ROW;
    paint.fillStyle = "#66717f";
    paint.fillText(contact.name, 4, top + ROW - 1);
    const step = Math.max(1, Math.floor(run.rows / (2 * width)));
    const column = Math.max(1, ((width - LEFT) * step) / run.rows + 0.5);
    for (let row = 0; row < run.rows; row += step) {
      const obstacle = run.value(row, "force_obstacle", c);
      const floor = run.value(row, "force_floor", c);
      if (Math.max(obstacle, floor) < CARRIES) continue;
      paint.fillStyle = obstacle >= floor ? "#16964c" : "#8c3cbe";
      paint.fillRect(this.x(run.time(row), width), top + 1, column, ROW - 2);
    }
  }

  showTime(time) {
    this.time = time;
    if (!this.still || this.still.width === 0) return;
    const paint = this.canvas.getContext("2d");
    paint.clearRect(0, 0, this.canvas.width, this.canvas.height);
    paint.drawImage(this.still, 0, 0);
    const scale = window.devicePixelRatio;
    paint.fillStyle = "#1e2732";
    paint.fillRect(this.x(time, this.canvas.clientWidth) * scale - 1, 0, 2, this.canvas.height);
  }
}
