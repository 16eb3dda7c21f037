// The drawing of a machine: SVG in world coordinates that follows the width of the page, with a slider and Play.

import { View, make, pathData, put, roundStep, text } from "./drawing.js";
import { player } from "./play.js";

const GRID_PIXELS = 60;
const SHARE = 0.56; // height over width, within the pixels below
const [LEAST, MOST] = [240, 520];
const [LETTER, LINE] = [9, 18]; // pixels that a letter of a name is wide, and high

/**
 * A name beside a place of the drawing, in the symbols of the documents: `l2` and `theta_1` get their index. Returns the function that
 * lays it beside a place; it is not shown where a name that was made before it lies.
 */
export function symbol(layer, name) {
  const others = [...layer.querySelectorAll(".symbol")],
    wide = LETTER * name.length + 4;
  const word = make("text", { class: "symbol", visibility: "hidden", "data-wide": wide }, layer),
    [, letter, index] = /^([A-Za-zΑ-ωθαβγφξε′]+)_?(\w*)(?:′)?$/.exec(name) ?? [null, name, ""];
  word.append(letter);
  if (index) make("tspan", { class: "index", dy: "3" }, word).textContent = index;
  if (name.endsWith("′")) make("tspan", { dy: index ? "-3" : "0" }, word).textContent = "′";
  const on = (x, y) => (other) => {
    const [left, low] = ["x", "y"].map((side) => Number(other.getAttribute(side)));
    return (
      other.getAttribute("visibility") === "visible" &&
      Math.abs(y - low) < LINE &&
      x < left + Number(other.dataset.wide) &&
      left < x + wide
    );
  };
  return (at, view, dx = 9, dy = -8) => {
    const x = Math.max(4, Math.min(view.x(at[0]) + dx, view.width - wide)),
      y = view.y(at[1]) + dy;
    put(word, { x, y, visibility: others.some(on(x, y)) ? "hidden" : "visible" });
  };
}

/** A grid of round steps behind a drawing, with the step in words. */
export function grid(layer, view, unit = "") {
  const step = roundStep(GRID_PIXELS / view.scale),
    [left, high] = view.world(0, 0),
    [right, low] = view.world(view.width, view.height);
  let lines = "";
  for (let k = Math.ceil(left / step); k * step <= right; k++) lines += `M${view.x(k * step)} 0V${view.height}`;
  for (let k = Math.ceil(low / step); k * step <= high; k++) lines += `M0 ${view.y(k * step)}H${view.width}`;
  make("path", { class: "grid", d: lines }, layer);
  make("text", { class: "tick", x: 8, y: view.height - 8 }, layer).textContent = `grid ${text(step)} ${unit}`;
}

/** A polyline with the class `kind`; returns the function that lays it through other points. */
export function line(layer, kind, points = null, view = null, closed = false) {
  const path = make("path", { class: kind }, layer);
  const lay = (through, on) => put(path, { d: pathData(through, on) + (closed ? "Z" : "") });
  if (points) lay(points, view);
  return lay;
}

/** A pin or fixed pivot (`kind`) of `r` pixels; returns the function that places it. */
export function dot(layer, kind, r = 5) {
  const circle = make("circle", { class: kind, r }, layer);
  return ([x, y], view) => put(circle, { cx: view.x(x), cy: view.y(y) });
}

/**
 * Adds a drawing to `host`. `label` says what it shows; `extent` are the points that have to be seen. `draw(layer,
 * view)` draws into the SVG `layer` and returns `move(value)`, or nothing for a still; it is called again when the
 * width changes. `play`, if given, are the options of `player` without `show`; `words(value)` says the value, and `follow(value)`
 * hears of each move. Returns the player, null for a still.
 */
export function stage(host, { label, extent, draw, play = null, words = String, follow = () => {} }) {
  const svg = make("svg", { class: "stage", role: "img", "aria-label": label });
  let width = 0,
    move = null,
    run = null;
  host.append(svg);
  const redraw = () => {
    width = Math.max(svg.parentElement.clientWidth, 200);
    const view = new View(width, Math.min(MOST, Math.max(LEAST, SHARE * width)));
    view.fit(extent, 34);
    put(svg, { viewBox: `0 0 ${view.width} ${view.height}`, height: view.height });
    svg.replaceChildren();
    move = draw(svg, view);
    if (run) move(run.value);
  };
  redraw();
  if (play)
    run = player(host, {
      ...play,
      show: (value) => {
        move(value);
        follow(value);
        return words(value);
      },
    });
  new ResizeObserver(() => {
    if (svg.isConnected && svg.parentElement.clientWidth && svg.parentElement.clientWidth !== width) redraw();
  }).observe(host);
  return run;
}
