// Preview of the flat parts of a linkage: the contours of its plates file, side by side, with names and sizes.

import { redrawOn } from "./charts.js";
import { make, pathData, put, text } from "./drawing.js";
import { contoursOf } from "./outline.js";
import { $, listen } from "./shell.js";

const FLAT =
  "Flat parts as they will be cut, with overall sizes. Pins and posts are only in the files for 3D print and CAD.";
const WAIT_MS = 300; // after a change, before the parts are requested
const [WIDEST, HIGHEST] = [0.62, 130]; // of a part: its width as a fraction of the room, and its height in pixels
const [GAP, LINE, LETTER] = [14, 15, 6.4]; // pixels: between parts, a line of text, a letter

/** The parts of a plates file in millimetres, the largest first; equal washers or heads are one part with a `count`. */
function partsOf(content) {
  const layers = Map.groupBy(contoursOf(content), ({ layer }) => layer),
    parts = new Map();
  for (const [layer, contours] of layers) {
    const lines = contours.map(({ line }) => line),
      [xs, ys] = [0, 1].map((i) => lines.flat().map((point) => point[i])),
      [left, top, width, height] = [
        Math.min(...xs),
        Math.max(...ys),
        Math.max(...xs) - Math.min(...xs),
        Math.max(...ys) - Math.min(...ys),
      ],
      words = layer.toLowerCase().split("_"),
      name = /^(washer|head)$/.test(words[0]) ? words[0] : words.join(" "),
      key = `${name} ${width.toFixed(2)} ${height.toFixed(2)}`,
      part = parts.get(key) ?? { name, lines, left, top, width, height, count: 0 };
    part.count += 1;
    parts.set(key, part);
  }
  return [...parts.values()].sort((a, b) => b.width * b.height - a.width * a.height);
}

/** Draws the parts in rows into an SVG as wide as its parent. */
function drawParts(svg, parts) {
  const room = svg.parentNode.clientWidth,
    scale = Math.min(
      ...parts.flatMap(({ width, height }) => [(WIDEST * room) / (width || 1), HIGHEST / (height || 1)]),
    );
  let [x, y, rowHeight] = [GAP, GAP, 0];
  svg.replaceChildren();
  for (const { name, lines, left, top, width, height, count } of parts) {
    const title = count > 1 ? `${count} × ${name}` : name,
      sizes = `${text(width, 4)} × ${text(height, 4)} mm`,
      cell = Math.max(width * scale, LETTER * Math.max(title.length, sizes.length));
    if (x > GAP && x + cell > room - GAP) [x, y, rowHeight] = [GAP, y + rowHeight + GAP, 0];
    const [dx, dy] = [x, y],
      at = ([u, v]) => [dx + (u - left) * scale, dy + (top - v) * scale],
      group = make("g", { "data-part": name }, svg),
      words = { x, y: y + height * scale + LINE };
    make("path", { class: name, d: lines.map((line) => `${pathData(line.map(at))}Z`).join("") }, group);
    make("text", { class: "name", ...words, text: title }, group);
    make("text", { ...words, y: words.y + LINE, text: sizes }, group);
    x += cell + GAP;
    rowHeight = Math.max(rowHeight, height * scale + 2 * LINE);
  }
  const label = parts.map(({ name, count }) => (count > 1 ? `${count} ${name}s` : name)).join(", "),
    total = Math.ceil(y + rowHeight + GAP);
  put(svg, { viewBox: `0 0 ${room} ${total}`, width: room, height: total, "aria-label": `Flat parts: ${label}` });
}

export class Preview {
  #key = null;
  #parts = [];
  #control = null;
  #timer = null;

  /**
   * `request()` returns the request for the plates file of the selected linkage, or nothing before its layers are known;
   * `load(request, signal)` returns the reply.
   */
  constructor(request, load) {
    Object.assign(this, { request, load });
    redrawOn($("parts"), () => this.#show());
    listen("layers-card", "change", () => this.soon());
  }

  /** Shows the parts anew after the linkage, its drive or the sizes of its parts have changed. */
  soon() {
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#show(), WAIT_MS);
  }

  /** Draws the parts if there is room for them; the file is requested only if the request is another one. */
  async #show() {
    const host = $("parts"),
      request = host.clientWidth ? this.request() : null;
    if (!request) return;
    request.solids.allow_collisions = true; // the layers say what collides
    const key = JSON.stringify(request);
    if (key !== this.#key) {
      this.#control?.abort();
      const { signal } = (this.#control = new AbortController());
      let sentence = FLAT;
      if (!this.#parts.length) $("parts-note").textContent = "The preview of the parts is being prepared.";
      this.#key = key;
      try {
        this.#parts = partsOf(await (await this.load(request, signal)).text());
      } catch (error) {
        this.#parts = [];
        sentence = `No preview of the parts. ${error.message}`;
      }
      if (signal.aborted) return;
      $("parts-note").textContent = sentence;
    }
    drawParts(host.firstElementChild, this.#parts);
  }
}
