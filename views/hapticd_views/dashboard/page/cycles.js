// The last energy cycles, a bar each: how much energy the wall made in it. Made is bad, and has the colour of it.

import uPlot from "./vendor/uPlot.esm.js";
import { CalmRange, plain } from "./scale.js";

const MOST = 60;

export class CyclePlot {
  constructor(parent, output, store, theme) {
    this.output = output;
    this.store = store;
    this.theme = theme;
    this.range = new CalmRange(0.002);
    const axis = { stroke: () => theme.colour("dim"), font: "12px system-ui, sans-serif", ticks: { show: false } };
    this.uplot = new uPlot({
      width: 300, height: 120, padding: [8, 14, 8, 0], legend: { show: false }, cursor: { show: false },
      scales: { x: { time: false, auto: false, range: [-MOST, 0] }, y: { auto: false } },
      axes: [{ ...axis, show: false },
        { ...axis, size: 58, gap: 6, space: 26, values: (_, at) => at.map((y) => plain(y)), grid: { stroke: () => theme.colour("grid"), width: 1 } }],
      series: [{}, { paths: () => null, points: { show: false } }],
      hooks: { draw: [(uplot) => this.#drawBars(uplot)] },
    }, [[], []], parent);
    new ResizeObserver(() => {
      if (parent.clientWidth) this.uplot.setSize({ width: parent.clientWidth, height: parent.clientHeight });
    }).observe(parent);
  }

  draw() {
    const shown = this.store.cycles.slice(-MOST);
    const values = shown.map(({ generated_j: made }) => made * 1e3);
    this.uplot.setData([shown.map((_, index) => index + 0.5 - shown.length), values], false);
    this.uplot.batch(() => {
      this.uplot.setScale("x", { min: -MOST, max: 0 });
      const [low, high] = this.range.fit(Math.min(0, ...values), Math.max(0, ...values), performance.now());
      this.uplot.setScale("y", { min: low, max: high });
    });
    const last = shown.at(-1);
    this.output.textContent = last
      ? `${last.cycle}: ${(last.duration_s * 1e3).toFixed(1)} ms, ${last.damping_n_s_per_m.toFixed(1)} N s/m` : "none yet";
  }

  #drawBars(uplot) {
    const { ctx: context, data: [at, values] } = uplot;
    const zero = uplot.valToPos(0, "y", true), width = uplot.bbox.width / MOST;
    for (let index = 0; index < at.length; index++) {
      const x = uplot.valToPos(at[index], "x", true) - width / 2, y = uplot.valToPos(values[index], "y", true);
      context.fillStyle = this.theme.colour(values[index] > 0 ? "made" : "taken");
      context.fillRect(x + 1, Math.min(zero, y), Math.max(1, width - 2), Math.max(1, Math.abs(y - zero)));
    }
    context.fillStyle = this.theme.colour("dim");
    context.fillRect(uplot.bbox.left, Math.round(zero), uplot.bbox.width, 1);
  }
}
