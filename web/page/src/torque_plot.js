// Torques of the chosen joints over time, each between its lowest and highest value, against limits.
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";

const COLOURS = ["#1c5cba", "#e06022", "#16964c", "#8c3cbe", "#b8860b"];

export class TorquePlot {
  /** @param seek called with the time that is clicked */
  constructor(element, seek) {
    this.element = element;
    this.seek = seek;
    this.time = 0;
    new ResizeObserver(() => this.plot?.setSize(this.size())).observe(element);
  }

  size() {
    return { width: Math.max(200, this.element.clientWidth - 12), height: 178 };
  }

  /** @param joints indices, at most as many as there are colours */
  choose(run, joints) {
    this.run = run;
    this.joints = joints.slice(0, COLOURS.length);
    this.plot?.destroy();
    const series = [{ label: "s" }];
    const bands = [];
    this.joints.forEach((j, i) => {
      const colour = COLOURS[i];
      const { name, limit } = run.scene.joints[j];
      series.push({ label: name, stroke: colour, width: 1, points: { show: false } });
      series.push({ label: `${name} low`, stroke: colour, width: 1, points: { show: false } });
      bands.push({ series: [series.length - 2, series.length - 1], fill: `${colour}40` });
      for (const label of ["limit", "-limit"])
        if (limit > 0)
          series.push({ label, stroke: `${colour}aa`, width: 1, dash: [6, 4], points: { show: false } });
    });
    this.plot = new uPlot(
      {
        ...this.size(),
        series,
        bands,
        legend: { show: false },
        scales: { x: { time: false } },
        axes: [{ size: 26 }, { size: 44, label: "N m", labelSize: 14 }],
        cursor: { drag: { x: false, y: false } },
        hooks: { draw: [(plot) => this.drawNow(plot)] },
      },
      this.columns(),
      this.element,
    );
    this.plot.over.addEventListener("click", (event) => {
      this.seek(this.plot.posToVal(event.offsetX, "x"));
    });
    this.drawNames();
  }

  drawNames() {
    const names = document.createElement("div");
    names.className = "names";
    this.joints.forEach((j, i) => {
      const name = document.createElement("span");
      name.textContent = `${this.run.scene.joints[j].name} `;
      name.style.color = COLOURS[i];
      names.append(name);
    });
    this.element.replaceChildren(names, this.plot.root);
    names.style.cssText = "position:absolute;margin:2px 56px;font-size:12px;z-index:1";
  }

  columns() {
    const { run } = this;
    const column = (value) => Float64Array.from({ length: run.rows }, (_, row) => value(row));
    const columns = [column((row) => run.time(row))];
    for (const j of this.joints) {
      columns.push(column((row) => run.value(row, "tau_high", j)));
      columns.push(column((row) => run.value(row, "tau_low", j)));
      const { limit } = run.scene.joints[j];
      if (limit > 0) columns.push(column(() => limit), column(() => -limit));
    }
    return columns;
  }

  refresh() {
    this.plot?.setData(this.columns());
  }

  showTime(time) {
    this.time = time;
    this.plot?.redraw(false);
  }

  drawNow(plot) {
    const x = plot.valToPos(this.time, "x", true);
    const { left, top, width, height } = plot.bbox;
    if (x < left || x > left + width) return;
    plot.ctx.fillStyle = "#1e2732";
    plot.ctx.fillRect(x - 1, top, 2, height);
  }
}
