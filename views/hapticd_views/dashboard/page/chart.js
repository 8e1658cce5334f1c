// One chart over time, with its heading and its figures.

import uPlot from "./vendor/uPlot.esm.js";
import { CalmRange, plain } from "./scale.js";

const AXIS_PX = 58;

export class TimeChart {
  /**
   * @param spec { title, unit, scale, least, digits, traces: [{ name, label, colour, alpha, quiet }] };
   *             `quiet` traces have no figure
   * @param options { theme, isLast, onSelect(x0, x1), onReset(), onCursor(x), draw(chart, context) }
   */
  constructor(parent, spec, options) {
    this.spec = spec;
    this.options = options;
    this.range = new CalmRange(spec.least);
    this.x = [-1, 0];
    this.panel = document.createElement("section");
    this.panel.className = "panel";
    this.panel.innerHTML = "<header><h2></h2><span class='unit'></span><output></output></header><div class='plot'></div>";
    this.panel.querySelector("h2").textContent = spec.title;
    this.panel.querySelector(".unit").textContent = spec.unit;
    this.figures = spec.traces.filter((trace) => !trace.quiet).map((trace) => this.#figure(trace));
    parent.append(this.panel);
    this.plot = this.panel.querySelector(".plot");
    this.uplot = new uPlot(this.#settings(), [[], ...spec.traces.map(() => [])], this.plot);
    this.uplot.over.addEventListener("dblclick", () => options.onReset());
    this.resize = new ResizeObserver(() => this.#fill());
    this.resize.observe(this.plot);
  }

  get pixels() {
    return Math.max(1, this.uplot.bbox.width);
  }

  /**
   * Show points between two times; `t` and the columns are plain arrays, x is counted from `origin`. Quiet traces set
   * the scale up to `most` only.
   */
  draw({ t, columns }, x0, x1, origin, most) {
    this.x = [x0, x1];
    const { scale } = this.spec;
    const values = this.spec.traces.map(({ name }) => columns[name].map((value) => (value === null ? null : value * scale)));
    this.uplot.setData([t.map((time) => time - origin), ...values], false);
    this.uplot.batch(() => {
      this.uplot.setScale("x", { min: x0, max: x1 });
      const [low, high] = this.range.fit(...extent(values, this.spec.traces, most), performance.now());
      this.uplot.setScale("y", { min: low, max: high });
    });
  }

  /** Write one value for each figure. */
  say(valueOf) {
    for (const { trace, output } of this.figures) {
      const value = valueOf(trace.name) * this.spec.scale;
      output.textContent = Number.isFinite(value) ? value.toFixed(this.spec.digits).replace("-", "−") : "–";
    }
  }

  redraw() {
    this.uplot.redraw(false, true);
  }

  remove() {
    this.resize.disconnect();
    this.uplot.destroy();
    this.panel.remove();
  }

  #figure(trace) {
    const span = document.createElement("span");
    span.className = `k-${trace.colour}`;
    const label = document.createElement("em"), output = document.createElement("b");
    label.textContent = trace.label;
    span.append(label, output);
    this.panel.querySelector("output").append(span);
    return { trace, output };
  }

  #settings() {
    const { theme, isLast, onSelect, onCursor, draw } = this.options;
    const ink = () => theme.colour("dim"), grid = { stroke: () => theme.colour("grid"), width: 1 };
    const axis = { stroke: ink, grid, ticks: { show: false }, font: "12px system-ui, sans-serif" };
    return {
      width: 300, height: 80, padding: [8, 18, isLast ? 0 : 6, 0], legend: { show: false },
      cursor: { sync: { key: "time", setSeries: false }, y: false, points: { show: false },
        drag: { x: true, y: false, setScale: false } },
      scales: { x: { time: false, auto: false }, y: { auto: false } },
      axes: [
        { ...axis, size: isLast ? 22 : 0, gap: 2, space: 70,
          values: (_, at) => at.map((x) => (isLast ? seconds(x, this.x) : "")) },
        { ...axis, size: AXIS_PX, gap: 6, space: 18, values: (_, at) => at.map((y) => plain(y)) },
      ],
      series: [{}, ...this.spec.traces.map(({ colour, alpha }) => ({
        stroke: () => theme.colour(colour), width: 1.5, alpha: alpha ?? 1, spanGaps: false, points: { size: 4 } }))],
      hooks: {
        drawAxes: [(uplot) => draw(this, uplot.ctx, uplot)],
        setCursor: [(uplot) => onCursor(uplot.cursor.left >= 0 ? uplot.posToVal(uplot.cursor.left, "x") : null)],
        setSelect: [(uplot) => {
          const { left, width } = uplot.select;
          if (width > 3) onSelect(uplot.posToVal(left, "x"), uplot.posToVal(left + width, "x"));
          if (width) uplot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
        }],
      },
    };
  }

  #fill() {
    const { clientWidth: width, clientHeight: height } = this.plot;
    if (width && height) this.uplot.setSize({ width, height });
  }
}

function extent(columns, traces, most) {
  let low = Infinity, high = -Infinity;
  columns.forEach((values, index) => {
    const bound = traces[index].quiet ? most : Infinity;
    for (const value of values) {
      if (value === null) continue;
      if (value < low) low = Math.max(value, -bound);
      if (value > high) high = Math.min(value, bound);
    }
  });
  return [low, high];
}

function seconds(x, [x0, x1]) {
  const milli = x1 - x0 <= 0.5;
  const value = milli ? x * 1000 : x;
  return `${plain(value)} ${milli ? "ms" : "s"}`;
}
