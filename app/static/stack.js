// The layers of a linkage from the side: a row for each, plates between their pins, and pins upright through them.

import { make, put } from "./drawing.js";

const COLUMNS = ["M", "G", "K", "Q", "A1", "A", "A2", "D", "P", "C", "B1", "B", "B2"]; // pins from left to right
const [WIDE, HIGH, LEFT] = [64, 26, 42]; // pixels between columns and layers, and beside them

/** Draws an assembly into an SVG. */
export function drawStack(svg, { count, parts, status }) {
  const used = COLUMNS.filter((name) => parts.some((piece) => piece.name.endsWith(`_${name}`))),
    plates = parts.filter(({ kind }) => kind === "plate"),
    rows = parts.flatMap(({ layers }) => layers),
    high = Math.max(...rows);
  const x = (name) => LEFT + 30 + WIDE * used.indexOf(name),
    y = (layer) => 8 + HIGH * (high - layer),
    width = LEFT + WIDE * (used.length - 1) + 90,
    height = y(Math.min(...rows)) + HIGH + 4;
  const named = plates
    .toSorted((a, b) => b.layers[0] - a.layers[0])
    .map(({ name, layers }) => `${name} in layer ${layers[0]}`);
  const label = `${count} layers from the side, from the top: ${named.join(", ")}`;
  put(svg, { viewBox: `0 0 ${width} ${height}`, width, height, role: "img", "aria-label": label });
  svg.classList.toggle("blocked", status === "blocked");
  for (let layer = 1; layer <= count; layer += 1)
    make("text", { class: "number", x: 4, y: y(layer) + HIGH / 2 + 4, text: layer }, svg);
  const box = (kind, left, right, top, bottom, rx) =>
    make("rect", { class: kind, x: left, y: top, width: right - left, height: bottom - top, rx }, svg);
  for (const { name, kind, holes, slits, layers } of parts) {
    if (kind !== "plate" && kind !== "board") continue;
    const pins =
        kind === "board" ? used : [...holes, ...slits].map(({ pin }) => pin).filter((pin) => used.includes(pin)),
      at = pins.map(x),
      beside = kind === "board" ? 26 : 14,
      left = Math.min(...at) - beside,
      right = Math.max(left + 28, Math.max(...at) + beside),
      top = y(layers[0]);
    box(`${kind} ${name}`, left, right, top + 4, top + HIGH - 4, 3);
    const words = kind === "board" ? "board" : name;
    make("text", { class: `name ${kind}`, x: (left + right) / 2, y: top + HIGH / 2 + 4, text: words }, svg);
  }
  for (const { name, kind, layers } of parts) {
    if (kind === "plate" || kind === "board") continue;
    const pin = name.split("_")[1],
      [wide, inset] = kind === "head" ? [9, 8] : [4, 2];
    box(kind, x(pin) - wide, x(pin) + wide, y(layers[1]) + inset, y(layers[0]) + HIGH - inset, 1.5);
    if (kind !== "head") make("text", { class: "pin-name", x: x(pin) + 7, y: y(layers[1]) + 1, text: pin }, svg);
  }
}
