// SVG drawing in world coordinates (y up): elements, views, paths, linkages; and numbers as text.

import { add, along, times, turned } from "./plane.js";
import { build } from "./shell.js";

const SVG = "http://www.w3.org/2000/svg";

/** An SVG element in `parent`; the attribute `text` is its content. */
export function make(name, attributes = {}, parent = null) {
  const node = document.createElementNS(SVG, name);
  put(node, attributes);
  parent?.append(node);
  return node;
}

export function put(node, { text: content, ...attributes }) {
  if (content !== undefined) node.textContent = content;
  for (const [key, value] of Object.entries(attributes))
    if (node.getAttribute(key) !== String(value)) node.setAttribute(key, value);
}

/** An HTML element with a class, and text or elements in it. */
export const element = (name, className, ...content) => build(name, { className }, ...content);

/** A button that does `act` when it is pressed. */
export const button = (words, act, className = "", more = {}) =>
  build("button", { className, type: "button", onclick: act, ...more }, words);

/** A list of terms and their descriptions, rows [term, words or element]. */
export function definitions(rows) {
  const parts = rows.map(([term, words]) => [
    element("dt", "", term),
    words.nodeType ? words : element("dd", "", words),
  ]);
  return build("dl", {}, ...parts);
}

/** A table with rows of cells; `head` names its columns, and with `named` the first cell of each row names that row. */
export function tableOf(head, rows, named = false) {
  const cell = (content, scope) =>
    scope && content !== "" ? build("th", { scope }, content) : element("td", "", content);
  const line = (cells) => build("tr", {}, cells),
    top = head?.map((name) => cell(name, "col")),
    lines = rows.map((row) => line(row.map((content, k) => cell(content, named && !k && "row"))));
  return build("table", {}, top && build("thead", {}, line(top)), build("tbody", {}, lines));
}

/** A table of rows [name, value]. */
export const namedRows = (rows) => tableOf(null, rows, true);

/** A sign, which screen readers skip, and what it stands for. */
export const signed = (name, className, sign, words) =>
  element(name, className, build("span", { className: "sign", "aria-hidden": "true" }, sign), ` ${words}`);

/** Path data of the icons of a button that runs and stops. */
export const ICONS = { Play: "M6 3.5v13l11-6.5z", Pause: "M5.5 3.5h3v13h-3zM11.5 3.5h3v13h-3z" };

/** A pixel as far away as a drawing can have it: SVG's numbers end at 3e38. */
const within = (pixel) => Math.min(Math.max(pixel, -1e9), 1e9);

/** The mapping between world coordinates and pixels: centre `cx`, `cy` and `scale` in pixels per unit. */
export class View {
  constructor(width, height) {
    Object.assign(this, { width, height, cx: 0, cy: 0, scale: 1 });
  }

  x(value) {
    return within((value - this.cx) * this.scale + this.width / 2);
  }

  y(value) {
    return within(this.height / 2 - (value - this.cy) * this.scale);
  }

  at([x, y]) {
    return [this.x(x), this.y(y)];
  }

  world(px, py) {
    return [(px - this.width / 2) / this.scale + this.cx, (this.height / 2 - py) / this.scale + this.cy];
  }

  /** Fits all points into the view with a border of `pad` pixels. */
  fit(points, pad) {
    const good = points.filter((p) => p && p.every(Number.isFinite));
    if (!good.length) good.push([-60, -40], [60, 40]);
    const ends = [0, 1].map((i) =>
        good.reduce(([low, high], p) => [Math.min(low, p[i]), Math.max(high, p[i])], [Infinity, -Infinity]),
      ),
      minExtent = 1e-9 * Math.max(...ends.flat().map(Math.abs)) || 1,
      scale = (pixels, [low, high]) => Math.max(pixels - 2 * pad, 20) / Math.max(high - low, minExtent);
    [this.cx, this.cy] = ends.map(([low, high]) => (low + high) / 2);
    this.scale = Math.min(scale(this.width, ends[0]), scale(this.height, ends[1]));
  }

  zoom(factor, px = this.width / 2, py = this.height / 2) {
    const [x, y] = this.world(px, py);
    this.scale *= factor;
    this.cx = x - (px - this.width / 2) / this.scale;
    this.cy = y + (py - this.height / 2) / this.scale;
  }
}

const short = (value) => Math.round(value * 100) / 100;

/** Path data of a polyline, without a view of pixels; a null point interrupts it. */
export function pathData(points, view = null) {
  const step = (point, k) => {
    if (!point) return "";
    const [x, y] = view ? view.at(point) : point;
    return `${points[k - 1] ? "L" : "M"}${short(x)} ${short(y)}`;
  };
  return points.map(step).join("");
}

/** Path data of the way of the body point, or else of C, of a linkage at joints of `Linkage.at`. */
export function pointPath(joints, view) {
  const points = joints.map((j) => j && (j.p ?? j.c));
  return pathData(points, view);
}

/** Return the smallest 1, 2 or 5 times a power of ten that is at least `minStep`. */
export function roundStep(minStep) {
  const power = 10 ** Math.floor(Math.log10(minStep));
  return [1, 2, 5, 10].map((k) => k * power).find((step) => step >= minStep * 0.999999);
}

/** A number rounded to `digits` digits, in exponential notation where it is very large or small. */
export function text(value, digits = 6) {
  if (value === null || value === undefined) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  const rounded = Number(value.toPrecision(digits));
  return size >= 1e7 || size < 1e-4 ? rounded.toExponential() : String(rounded);
}

/** Draws the grid into `layer`; returns its step. */
export function drawGrid(layer, view) {
  const { width, height } = view,
    step = roundStep(56 / view.scale),
    digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const name = (value) => (Math.abs(value) >= 1e6 || digits > 5 ? text(value, 4) : value.toFixed(Math.min(digits, 20))),
    [left, high] = view.world(0, 0),
    [right, low] = view.world(width, height);
  const lines = (from, to, pixel) => {
    const first = Math.ceil(from / step),
      count = Math.min(400, Math.floor(to / step) - first + 1);
    return Array.from({ length: Math.max(0, count) }, (_, n) => [
      first + n,
      Math.round(pixel((first + n) * step)) + 0.5,
    ]);
  };
  const paths = { grid: "", axis: "" },
    ticks = [];
  for (const [k, x] of lines(left, right, (value) => view.x(value))) {
    paths[k ? "grid" : "axis"] += `M${x} 0V${height}`;
    if (x > 34 && x < width - 14) ticks.push({ x, y: height - 6, "text-anchor": "middle", text: name(k * step) });
  }
  for (const [k, y] of lines(low, high, (value) => view.y(value))) {
    paths[k ? "grid" : "axis"] += `M0 ${y}H${width}`;
    if (y > 14 && y < height - 22) ticks.push({ x: 5, y: y - 3, text: name(k * step) });
  }
  layer.replaceChildren();
  for (const [kind, d] of Object.entries(paths)) make("path", { class: kind, d }, layer);
  for (const tick of ticks) make("text", { class: "tick", "aria-hidden": "true", ...tick }, layer);
  return step;
}

/** Names of joints, and the class and radius of their pins. */
const JOINTS = {
  a: ["A", "fixed", 1.5],
  b: ["B", "fixed", 1.5],
  c: ["C", "pin", 0],
  d: ["D", "pin", 0],
  p: ["P", "point", 0],
};
/** The lines of a linkage, from the lowest up, with their classes. */
const LINES = {
  bases: "bearing",
  rails: "rail",
  ground: "ground",
  body: "body",
  slots: "slot",
  blocks: "block",
  crank: "link crank",
  rocker: "link rocker",
};
const HATCHES = [-12, -6, 0, 6, 12];

/** A pivot's bearing on hatched ground, in pixels. */
const bearing = ([x, y]) =>
  `M${x} ${y}l-8 14h16zM${x - 14} ${y + 14}h28${HATCHES.map((dx) => `M${x + dx} ${y + 14}l-5 6`).join("")}`;

/** The SVG elements of one linkage; without `detail` pins are small, and bearings, names and direction are left out. */
export class LinkageShape {
  constructor(parent, detail = true) {
    this.group = make("g", { "aria-hidden": "true", class: detail ? "large" : "small" }, parent);
    for (const [name, kind] of Object.entries(LINES)) this[name] = make("path", { class: kind }, this.group);
    Object.assign(this, { detail, joints: {}, names: {} });
    for (const [name, [, kind, more]] of Object.entries(JOINTS))
      this.joints[name] = make("circle", { class: kind, r: (detail ? 5 : 2.6) + more, "data-joint": name }, this.group);
    this.carried = make("path", { class: "carried" }, this.group);
    for (const [name, [letter]] of Object.entries(JOINTS))
      this.names[name] = make("text", { class: "joint-name", text: letter }, this.group);
  }

  /** A slider or block, turned by an angle, as path data. */
  #block(at, angle) {
    const [u, v] = this.detail ? [15, 8] : [7, 4],
      corner = (sideways, up) => add(at, turned([sideways * u, up * v], -angle));
    return `${pathData([corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)])}Z`;
  }

  /** Draws the linkage at joints of `Linkage.at`, and the body's direction if it counts; null hides it. */
  show(joints, view, directed = true) {
    this.group.setAttribute("visibility", joints ? "visible" : "hidden");
    if (!joints) return;
    const { a, b, c, d, p, rails, slots, blocks, links, ground, fixed } = joints;
    put(this.ground, { d: ground ? pathData(ground, view) : "" });
    const lines = (all) => all.map((line) => pathData(line, view)).join("");
    put(this.rails, { d: lines(rails) });
    put(this.slots, { d: lines(slots) });
    put(this.blocks, { d: blocks.map(([at, angle]) => this.#block(view.at(at), angle)).join("") });
    put(this.body, { d: `${pathData(p ? [d, c, p] : [d, c], view)}Z` });
    put(this.crank, { d: links[0] ? pathData(links[0], view) : "" });
    put(this.rocker, { d: links[1] ? pathData(links[1], view) : "" });
    for (const [name, position] of Object.entries({ a, b, c, d, p })) {
      const dot = this.joints[name];
      dot.setAttribute("visibility", position ? "inherit" : "hidden");
      this.names[name].setAttribute("visibility", position && this.detail ? "inherit" : "hidden");
      if (!position) continue;
      const [x, y] = view.at(position);
      put(dot, { cx: x, cy: y });
      put(this.names[name], { x: x + 10, y: y - 8 });
    }
    if (!this.detail) return;
    const pivots = [a, b].filter((_, k) => fixed[k]);
    put(this.bases, { d: pivots.map((pivot) => bearing(view.at(pivot))).join("") });
    if (p || !directed) {
      const at = p && view.at(p);
      put(this.carried, { d: directed ? pathData([at, add(at, times(along(-joints.rotation), 26))]) : "" });
    }
  }
}

/**
 * A small picture of a linkage where it first closes, with the path of its body point between two travels in radians;
 * its `move(share)` shows the linkage at a fraction of the way.
 */
export function thumbnail(linkage, [first, last], targets, width = 160, height = 112) {
  const svg = make("svg", { viewBox: `0 0 ${width} ${height}`, "aria-hidden": "true" });
  const view = new View(width, height);
  const used = linkage.over(first, last, 60);
  const start = used.find(Boolean);
  if (!start) return svg;
  view.fit([start.a, start.b, ...used.flatMap((j) => (j ? [j.d, j.c, j.p] : [])), ...targets], 12);
  make("path", { class: "curve", d: pointPath(used, view) }, svg);
  const shape = new LinkageShape(svg, false);
  shape.show(start, view);
  svg.move = (share) => shape.show(linkage.at(first + share * (last - first)) ?? start, view);
  return svg;
}
