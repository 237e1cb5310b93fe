// One bar a joint: torque now against the limit, and a tick at its peak so far.
export class JointList {
  /** @param choose called with the indices of the joints to plot */
  constructor(list, choose) {
    this.list = list;
    this.choose = choose;
    this.chosen = [];
  }

  load(run) {
    this.run = run;
    this.items = run.scene.joints.map((joint, j) => {
      const item = document.createElement("li");
      item.innerHTML =
        '<span></span><span class="track"><span class="now"></span><span class="peak"></span></span><span class="value"></span>';
      item.firstChild.textContent = joint.name;
      item.addEventListener("click", () => this.toggle(j));
      return item;
    });
    this.list.replaceChildren(...this.items);
    this.sort();
    this.chosen = this.order.slice(0, 3);
    this.mark();
  }

  loadOf(torque, j) {
    const { limit } = this.run.scene.joints[j];
    return limit > 0 ? torque / limit : torque / 50;
  }

  /** The joint that came nearest to its limit first. */
  sort() {
    const order = this.run.scene.joints.map((_, j) => j);
    order.sort((a, b) => this.loadOf(this.run.peaks[b], b) - this.loadOf(this.run.peaks[a], a));
    if (order.join() === this.order?.join() && this.list.childElementCount === order.length) return;
    this.order = order;
    this.list.replaceChildren(...order.map((j) => this.items[j]));
  }

  toggle(j) {
    this.chosen = this.chosen.includes(j)
      ? this.chosen.filter((each) => each !== j)
      : [...this.chosen, j].slice(-5);
    this.mark();
    this.choose(this.chosen);
  }

  mark() {
    this.items.forEach((item, j) => item.classList.toggle("chosen", this.chosen.includes(j)));
  }

  show(row) {
    const { run } = this;
    this.items.forEach((item, j) => {
      const torque = run.torque(row, j);
      const load = this.loadOf(torque, j);
      const [, track, value] = item.children;
      track.children[0].style.width = `${Math.min(100, 100 * load)}%`;
      track.children[1].style.left = `calc(${Math.min(100, 100 * this.loadOf(run.peaks[j], j))}% - 2px)`;
      value.textContent = `${torque.toFixed(1)} N m`;
      item.classList.toggle("near", load > 0.8 && load <= 1);
      item.classList.toggle("over", load > 1);
    });
  }
}
