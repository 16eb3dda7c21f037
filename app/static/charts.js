// Line charts over a shared abscissa, drawn by the vendored uPlot in the page's colours.

import { element, text } from "./drawing.js";

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

function axis(more = {}) {
  return {
    stroke: colour("muted"),
    font: "11px system-ui, sans-serif",
    labelFont: "12px system-ui, sans-serif",
    grid: { stroke: colour("line"), width: 1 },
    ticks: { stroke: colour("line"), width: 1, size: 4 },
    ...more,
  };
}

const degrees = (u, values) => values.map((value) => `${Number(value.toFixed(6))}°`);
const brief = (value) =>
  value === 0
    ? "0"
    : Math.abs(value) >= 1e5 || Math.abs(value) < 1e-3
      ? Number(value.toPrecision(2)).toExponential().replace("+", "")
      : String(Number(value.toPrecision(4)));

const decades = (u, splits) => splits.map((value) => (Math.abs(Math.log10(value) % 1) < 1e-9 ? value : null));

/**
 * A chart that fills `host`. `x` holds the abscissas, `series` are {values, colour, points, steps, size, width, dash};
 * nulls are gaps; with `sense` -1 the abscissas are named by their negatives. Returns the uPlot; `mark(x)` moves its vertical line.
 */
export function chart(
  host,
  {
    x,
    series,
    height = 130,
    degreesX = true,
    degreesY = false,
    logY = false,
    range = null,
    splits = null,
    xName = "",
    sense = 1,
  },
) {
  host.replaceChildren();
  const width = Math.max(200, host.clientWidth);
  let marked = null;
  const options = {
    width,
    height,
    legend: { show: false },
    cursor: { show: false },
    padding: [8, 26, 0, 0],
    scales: { x: { time: false }, y: logY ? { distr: 3 } : range ? { range } : {} },
    axes: [
      axis({
        size: 26,
        space: 60,
        values: (u, values) =>
          degreesX
            ? degrees(
                u,
                values.map((v) => sense * v),
              )
            : values.map((v) => `${brief(sense * v)}${xName}`),
      }),
      axis({
        size: 62,
        space: 22,
        ...(splits ? { splits: () => splits } : {}),
        ...(logY ? { grid: { ...axis().grid, filter: decades }, ticks: { ...axis().ticks, filter: decades } } : {}),
        values: degreesY ? degrees : (u, values) => values.map((v) => (v === null ? "" : brief(v))),
      }),
    ],
    series: [
      {},
      ...series.map((one) => ({
        pxAlign: 0,
        stroke: colour(one.colour),
        width: one.width ?? 1.8,
        dash: one.dash,
        spanGaps: Boolean(one.points),
        paths: one.points ? () => null : one.steps ? uPlot.paths.stepped({ align: 1 }) : undefined,
        points: {
          show: Boolean(one.points),
          size: one.size ?? 6,
          fill: colour(one.colour),
          stroke: colour(one.colour),
        },
      })),
    ],
    hooks: {
      draw: [
        (u) => {
          if (marked === null) return;
          const at = Math.round(u.valToPos(marked, "x", true)),
            { top, height: tall } = u.bbox;
          u.ctx.save();
          u.ctx.setLineDash([]);
          u.ctx.strokeStyle = colour("ink");
          u.ctx.lineWidth = devicePixelRatio;
          u.ctx.beginPath();
          u.ctx.moveTo(at, top);
          u.ctx.lineTo(at, top + tall);
          u.ctx.stroke();
          u.ctx.restore();
        },
      ],
    },
  };
  const plot = new uPlot(options, [x, ...series.map((one) => one.values)], host);
  plot.mark = (value) => {
    marked = value;
    plot.redraw(false, false);
  };
  plot.root.querySelectorAll("canvas").forEach((canvas) => canvas.setAttribute("aria-hidden", "true"));
  return plot;
}

/** A chart below a heading, added to `host`. Screen readers get the heading and the range of the first series. */
export function titledChart(host, title, options) {
  const block = document.createElement("div"),
    box = document.createElement("div");
  const values = options.series[0].values.filter((value) => value !== null);
  box.className = "chart";
  box.setAttribute("role", "img");
  box.setAttribute("aria-label", `${title}: from ${text(Math.min(...values), 4)} to ${text(Math.max(...values), 4)}`);
  block.append(element("h3", "note", title), box);
  host.append(block);
  return chart(box, options);
}

/** Calls `draw` when the page changes between light and dark, and when the width of `host` changes to other than 0. */
export function redrawOn(host, draw) {
  let width = host.clientWidth;
  new ResizeObserver(() => {
    if (host.clientWidth === width) return;
    width = host.clientWidth;
    if (width) draw();
  }).observe(host);
  document.addEventListener("themechange", draw);
}
