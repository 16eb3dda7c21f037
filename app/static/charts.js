// Line charts over a shared abscissa, drawn by the vendored uPlot in the page's colours.

import { element, text } from "./drawing.js";
import { build } from "./shell.js";

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

const line = (name) => ({ stroke: colour("line"), width: 1, ...(name === "ticks" && { size: 4 }) });
const axis = (more) => ({
  stroke: colour("muted"),
  font: "11px system-ui, sans-serif",
  labelFont: "12px system-ui, sans-serif",
  grid: line("grid"),
  ticks: line("ticks"),
  ...more,
});

const degrees = (value) => `${Number(value.toFixed(6))}°`;
function brief(value) {
  if (value === 0) return "0";
  const small = Math.abs(value) >= 1e5 || Math.abs(value) < 1e-3;
  return small ? Number(value.toPrecision(2)).toExponential().replace("+", "") : String(Number(value.toPrecision(4)));
}

/**
 * A chart that fills `host`. `x` holds the abscissas, `series` are {values, colour, points, width, dash};
 * nulls are gaps; with `sense` -1 the negatives of the abscissas are shown. Returns the uPlot; `mark(x)` moves its
 * line.
 */
function chart(host, { x, series, height = 130, range = null, splits = null, xName = "", sense = 1, ...more }) {
  const { degreesX = true, degreesY = false } = more,
    nameX = (v) => (degreesX ? degrees(sense * v) : `${brief(sense * v)}${xName}`),
    nameY = (v) => (degreesY ? degrees(v) : v === null ? "" : brief(v));
  let marked = null;
  const draw = (u) => {
    if (marked === null) return;
    const at = Math.round(u.valToPos(marked, "x", true)),
      { top, height: tall } = u.bbox;
    u.ctx.save();
    u.ctx.setLineDash([]);
    Object.assign(u.ctx, { strokeStyle: colour("ink"), lineWidth: devicePixelRatio });
    u.ctx.beginPath();
    u.ctx.moveTo(at, top);
    u.ctx.lineTo(at, top + tall);
    u.ctx.stroke();
    u.ctx.restore();
  };
  const curve = ({ points, width = 1.8, dash, ...item }) => {
    const stroke = colour(item.colour),
      paths = points ? () => null : undefined,
      show = Boolean(points);
    return { pxAlign: 0, stroke, width, dash, spanGaps: show, paths, points: { show, size: 6, fill: stroke, stroke } };
  };
  host.replaceChildren();
  const options = {
    width: Math.max(200, host.clientWidth),
    height,
    legend: { show: false },
    cursor: { show: false },
    padding: [8, 26, 0, 0],
    scales: { x: { time: false }, y: range ? { range } : {} },
    axes: [
      axis({ size: 26, space: 60, values: (u, values) => values.map(nameX) }),
      axis({ size: 62, space: 22, ...(splits && { splits: () => splits }), values: (u, v) => v.map(nameY) }),
    ],
    series: [{}, ...series.map(curve)],
    hooks: { draw: [draw] },
  };
  const plot = new uPlot(options, [x, ...series.map((item) => item.values)], host);
  plot.mark = (value) => {
    marked = value;
    plot.redraw(false, false);
  };
  for (const canvas of plot.root.querySelectorAll("canvas")) canvas.setAttribute("aria-hidden", "true");
  return plot;
}

/** A chart below a heading, added to `host`. Screen readers get the heading and the range of the first series. */
function titledChart(host, [title, options]) {
  const values = options.series[0].values.filter((value) => value !== null),
    range = [Math.min(...values), Math.max(...values)].map((value) => text(value, 4)).join(" to "),
    box = build("div", { className: "chart", role: "img", "aria-label": `${title}: from ${range}` });
  host.append(build("div", {}, element("h3", "note", title), box));
  return chart(box, options);
}

/** Charts in `host` with a common abscissa; `list()` returns [title, options of `chart`] of each. */
export class Charts {
  #charts = [];
  #at = null;

  constructor(host, list) {
    Object.assign(this, { host, list });
    redrawOn(host, () => this.draw());
  }

  draw() {
    const { host, list } = this;
    host.replaceChildren();
    this.#charts = host.clientWidth ? list().map((entry) => titledChart(host, entry)) : [];
    if (this.#at !== null) this.mark(this.#at);
  }

  /** Moves a line along all charts. */
  mark(value) {
    this.#at = value;
    for (const plot of this.#charts) plot.mark(value);
  }
}

/** Call `draw` when the page changes between light and dark, and when the width of `host` changes to other than 0. */
export function redrawOn(host, draw) {
  let width = host.clientWidth;
  const again = () => (host.isConnected ? draw() : document.removeEventListener("themechange", again));
  new ResizeObserver(() => {
    if (host.clientWidth === width) return;
    width = host.clientWidth;
    if (width) draw();
  }).observe(host);
  document.addEventListener("themechange", again);
}
