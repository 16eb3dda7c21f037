// The drawing of a machine: parts in world coordinates that follow the width of the page, with a slider and Play.

import { View, drawGrid, make, pathData, put } from "./drawing.js";
import { between } from "./plane.js";
import { player } from "./play.js";

const SHARE = 0.56; // height over width, within the pixels below
const [LEAST, MOST] = [240, 520];
const [LETTER, LINE] = [9, 18]; // pixels that a letter of a name is wide, and high

/** A value of a part: as it is, or what a function makes of the state of the machine. */
const valueAt = (value, state) => (typeof value === "function" ? value(state) : value);

/** A part whose path data `data(view, now)` makes. A part draws into a layer and returns what lays it for a state. */
export const path = (kind, data) => (layer, view) => {
  const node = make("path", {}, layer);
  return (now) => put(node, { class: valueAt(kind, now), d: data(view, now) });
};

/** A polyline with the class `kind` through points. */
export const line = (kind, points, closed = false) =>
  path(kind, (view, now) => pathData(valueAt(points, now), view) + (closed ? "Z" : ""));

/** A circle of the size that it has in the world. */
export const circle =
  (kind, [x, y], radius) =>
  (layer, view) => {
    make("circle", { class: kind, cx: view.x(x), cy: view.y(y), r: radius * view.scale }, layer);
    return () => {};
  };

/** A pin or fixed pivot (`kind`) of `r` pixels, which is hidden while it has no place. */
export const dot =
  (kind, at, r = 5) =>
  (layer, view) => {
    const node = make("circle", { class: kind, r }, layer);
    return (now) => {
      const position = valueAt(at, now);
      put(node, { visibility: position ? "visible" : "hidden" });
      if (position) put(node, { cx: view.x(position[0]), cy: view.y(position[1]) });
    };
  };

/**
 * A name beside a place of the drawing, in the symbols of the documents: `l2` and `theta_1` get their index. It is not
 * shown where a name that was made before it lies.
 */
export const symbol =
  (name, at, dx = 9, dy = -8) =>
  (layer, view) => {
    const earlier = [...layer.querySelectorAll(".symbol")],
      wide = LETTER * name.length + 4;
    const word = make("text", { class: "symbol", visibility: "hidden", "data-wide": wide }, layer),
      [, letter, index] = /^([A-Za-zΑ-ωθαβγφξε′]+)_?(\w*)(?:′)?$/.exec(name) ?? [null, name, ""];
    word.append(letter);
    if (index) make("tspan", { class: "index", dy: "3", text: index }, word);
    if (name.endsWith("′")) make("tspan", { dy: index ? "-3" : "0", text: "′" }, word);
    return (now) => {
      const position = valueAt(at, now),
        x = Math.max(4, Math.min(view.x(position[0]) + dx, view.width - wide)),
        y = view.y(position[1]) + dy;
      const covers = (label) => {
        const [left, low, width] = ["x", "y", "data-wide"].map((side) => Number(label.getAttribute(side))),
          isVisible = label.getAttribute("visibility") === "visible";
        return isVisible && Math.abs(y - low) < LINE && x < left + width && left < x + wide;
      };
      put(word, { x, y, visibility: earlier.some(covers) ? "hidden" : "visible" });
    };
  };

/** A grid of round steps behind a drawing. */
export const grid = (layer, view) => {
  drawGrid(make("g", {}, layer), view);
  return () => {};
};

/**
 * Adds a drawing to `host`. `label` says what it shows; `extent` are the points that have to be seen; `parts` are drawn
 * from the lowest up, and laid for `state(value)`, first for `value`. `play`, if given, are the options of `player`
 * without `show`; `words(value)` says the value, and `follow(value)` hears of each move. Returns {go(value), value}.
 */
export function stage(host, options) {
  const { label, extent, parts, state = (now) => now, value = null, play, words = String, follow = () => {} } = options,
    svg = make("svg", { class: "stage", role: "img", "aria-label": label });
  let width = 0,
    laid = [],
    at = value ?? play?.from ?? 0;
  const go = (now) => {
    const moved = state(now);
    at = now;
    for (const lay of laid) lay(moved);
  };
  const redraw = () => {
    width = Math.max(svg.parentElement.clientWidth, 200);
    const view = new View(width, Math.min(MOST, Math.max(LEAST, SHARE * width)));
    view.fit(extent, 34);
    put(svg, { viewBox: `0 0 ${view.width} ${view.height}`, height: view.height });
    svg.replaceChildren();
    laid = parts.filter(Boolean).map((part) => part(svg, view));
    go(at);
  };
  host.append(svg);
  redraw();
  new ResizeObserver(() => {
    if (svg.isConnected && svg.parentElement.clientWidth && svg.parentElement.clientWidth !== width) redraw();
  }).observe(host);
  if (!play) return { go };
  const show = (now) => {
    go(now);
    follow(now);
    return words(now);
  };
  return player(host, { ...play, show });
}

/** The states of a machine between those at even steps of `values`. */
export const steps = (values, states) => (value) => {
  const [first, last] = [values[0], values.at(-1)],
    at = Math.min(Math.max((value - first) / (last - first), 0), 1) * (values.length - 1),
    k = Math.min(Math.floor(at), values.length - 2);
  return between(states[k], states[k + 1], at - k);
};
