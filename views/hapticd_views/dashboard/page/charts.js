// The column of charts: what is in them, and what is drawn between their grid and their curves.

import { TimeChart } from "./chart.js";
import { decimated } from "./decimate.js";

const MARKED = 111; // the event of `hapticd mark`
const COLOURS = ["x", "y", "z"];

/** What the charts show of a device with these axes, such as ["z"]. */
function specs(axes) {
  const colour = (label, index) => (axes.length === 1 ? "z" : COLOURS.includes(label) ? label : COLOURS[index % 3]);
  const each = (kind, more = {}) => axes.map((label, index) => (
    { name: kind + index, label: axes.length === 1 ? "" : label, colour: colour(label, index), ...more }));
  return [
    { title: "Position", unit: "mm", scale: 1e3, least: 0.05, digits: 3, traces: each("x") },
    { title: "Force", unit: "N", scale: 1, least: 0.2, digits: 3,
      traces: [...each("r", { quiet: true, alpha: 0.4 }), ...each("f")] },
    { title: "Energy", unit: "mJ", scale: 1e3, least: 0.02, digits: 3, traces: [
      { name: "energy", label: "in", colour: "energy" }, { name: "dissipated", label: "taken", colour: "taken" },
      { name: "generated", label: "made", colour: "made" }] },
    { title: "Damping", unit: "N s/m", scale: 1, least: 1, digits: 2,
      traces: [{ name: "damping", label: "law", colour: "damping" }] },
    { title: "Lateness", unit: "µs", scale: 1, least: 100, digits: 0,
      traces: [{ name: "busy", label: "tick body", colour: "taken" }, { name: "late", label: "late", colour: "late" }] },
  ];
}

export class Charts {
  constructor(parent, store, theme, view) {
    this.parent = parent;
    this.store = store;
    this.theme = theme;
    this.view = view;
    this.list = [];
    this.axes = "";
    this.cursor = null;
  }

  /** Draw what the view shows. */
  draw() {
    const ring = this.view.ring;
    this.#build(ring.axes);
    const { t0, t1, origin } = this.view.range();
    if (Number.isNaN(t1)) return;
    const names = this.list.flatMap(({ spec }) => spec.traces.map(({ name }) => name));
    const points = decimated(ring, t0, t1, [...names, "contacts"], this.list[0].pixels);
    this.contacts = { t: points.t.map((time) => time - origin), values: points.columns.contacts };
    this.origin = origin;
    // What was asked for, and not let through, has no bound: it sets no scale beyond twice the limit.
    const most = 2 * (this.store.status?.max_force_n || Infinity);
    for (const chart of this.list) chart.draw(points, t0 - origin, t1 - origin, origin, most);
    this.#say();
  }

  redraw() {
    for (const chart of this.list) chart.redraw();
  }

  /** The figures: of the tick under the pointer, or of the latest one. */
  #say() {
    const ring = this.view.ring;
    const row = this.cursor === null ? ring.end - 1 : Math.min(ring.end - 1, ring.rowAt(this.cursor + this.origin));
    for (const chart of this.list) chart.say((name) => ring.value(name, row));
  }

  #build(count) {
    const said = this.store.status?.axes ?? [];
    const axes = Array.from({ length: count }, (_, index) => said[index] ?? COLOURS[index] ?? `axis ${index + 1}`);
    if (this.axes === axes.join()) return;
    this.axes = axes.join();
    for (const chart of this.list) chart.remove();
    const all = specs(axes);
    this.list = all.map((spec, index) => new TimeChart(this.parent, spec, {
      theme: this.theme,
      isLast: index === all.length - 1,
      onSelect: (x0, x1) => this.view.zoom(x0, x1),
      onReset: () => this.view.zoom(null),
      onCursor: (x) => { this.cursor = x; this.#say(); },
      draw: (chart, context, uplot) => this.#drawBehind(chart, context, uplot),
    }));
  }

  #drawBehind(chart, context, uplot) {
    const { left, top, width, height } = uplot.bbox;
    context.save();
    context.beginPath();
    context.rect(left, top, width, height);
    context.clip();
    this.#drawContact(context, uplot);
    for (const { t } of this.store.gaps) this.#line(context, uplot, t - this.origin, "warn");
    for (const { code, timestamp } of this.store.events) {
      if (code === MARKED) this.#line(context, uplot, timestamp - this.origin, "dim");
    }
    if (this.view.isTriggered) this.#line(context, uplot, 0, "ink");
    if (chart.spec.title === "Position") this.#drawWalls(context, uplot);
    if (chart.spec.title === "Energy") this.#drawCycles(context, uplot, chart.spec.scale);
    context.restore();
  }

  #drawContact(context, uplot) {
    const { t, values } = this.contacts ?? { t: [], values: [] };
    const { top, height } = uplot.bbox;
    context.fillStyle = this.theme.colour("contact");
    for (let i = 0; i < t.length; i++) {
      if (!(values[i] > 0)) continue;
      const from = i;
      while (i + 1 < t.length && values[i + 1] > 0) i++;
      const x0 = uplot.valToPos(t[from], "x", true), x1 = uplot.valToPos(t[Math.min(i + 1, t.length - 1)], "x", true);
      context.fillRect(x0, top, Math.max(1, x1 - x0), height);
    }
  }

  #line(context, uplot, x, colour) {
    const { top, height } = uplot.bbox;
    context.fillStyle = this.theme.colour(colour);
    context.fillRect(Math.round(uplot.valToPos(x, "x", true)), top, Math.max(1, devicePixelRatio), height);
  }

  #drawWalls(context, uplot) {
    const { left, width } = uplot.bbox;
    context.strokeStyle = this.theme.colour("wall");
    context.setLineDash([6, 5]);
    for (const position of this.store.status?.wall_position_m ?? []) {
      const y = Math.round(uplot.valToPos(position * 1e3, "y", true)) + 0.5;
      context.beginPath();
      context.moveTo(left, y);
      context.lineTo(left + width, y);
      context.stroke();
    }
    context.setLineDash([]);
  }

  /** The end of each cycle, as a dot on the curve; one a pixel is enough. */
  #drawCycles(context, uplot, scale) {
    let last = -Infinity;
    for (const cycle of this.store.cycles) {
      const x = Math.round(uplot.valToPos(cycle.timestamp - this.origin, "x", true));
      if (x < uplot.bbox.left || x < last + 2) continue;
      last = x;
      context.fillStyle = this.theme.colour(cycle.generated_j > 0 ? "made" : "taken");
      context.beginPath();
      context.arc(x, uplot.valToPos(cycle.energy_j * scale, "y", true), 2.5 * devicePixelRatio, 0, 2 * Math.PI);
      context.fill();
    }
  }
}
