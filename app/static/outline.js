// The outline of a body from an SVG or a DXF file: polylines with y up, from the middle of their extent.

import { RAD } from "./plane.js";

const ARC_STEP = 10; // degrees
const CURVE_POINTS = 64;
const MOST_POINTS = 4000;

function arc(x, y, radius, first, last) {
  const steps = Math.max(2, Math.ceil(Math.abs(last - first) / ARC_STEP));
  return Array.from({ length: steps + 1 }, (_, k) => {
    const angle = (first + ((last - first) * k) / steps) * RAD;
    return [x + radius * Math.cos(angle), y + radius * Math.sin(angle)];
  });
}

/** The way from a vertex to the next one of a DXF polyline; `bulge` is the tangent of a quarter of the arc's angle. */
function bulged([x0, y0], [x1, y1], bulge) {
  if (!bulge) return [[x1, y1]];
  const angle = 4 * Math.atan(bulge),
    chord = Math.hypot(x1 - x0, y1 - y0),
    radius = chord / (2 * Math.sin(Math.abs(angle) / 2));
  const away = (radius * Math.cos(angle / 2) * Math.sign(bulge)) / (chord || 1);
  const cx = (x0 + x1) / 2 - away * (y1 - y0),
    cy = (y0 + y1) / 2 + away * (x1 - x0);
  const first = Math.atan2(y0 - cy, x0 - cx) / RAD;
  return arc(cx, cy, radius, first, first + angle / RAD).slice(1);
}

/** Entities of a DXF text: [{type, codes: [[code, value], ...]}]. */
function entities(content) {
  const rows = content.split(/\r\n|\r|\n/).map((row) => row.trim()),
    found = [];
  let inside = false;
  for (let k = 0; k + 1 < rows.length; k += 2) {
    const code = Number(rows[k]),
      value = rows[k + 1];
    if (code === 2 && value === "ENTITIES") inside = true;
    else if (code === 0 && value === "ENDSEC") inside = false;
    else if (inside && code === 0) found.push({ type: value, codes: [] });
    else if (inside && found.length) found.at(-1).codes.push([code, value]);
  }
  return found;
}

function fromDxf(content) {
  const lines = [];
  let vertices = null,
    closed = false;
  const join = (points, isClosed) => {
    const line = [points[0].at];
    points.forEach(({ at, bulge }, k) => {
      const next = points[k + 1] ?? (isClosed ? points[0] : null);
      if (next) line.push(...bulged(at, next.at, bulge));
    });
    lines.push(line);
  };
  for (const { type, codes } of entities(content)) {
    const one = (code, none = 0) => Number(codes.find(([at]) => at === code)?.[1] ?? none);
    if (type === "LINE")
      lines.push([
        [one(10), one(20)],
        [one(11), one(21)],
      ]);
    else if (type === "CIRCLE") lines.push(arc(one(10), one(20), one(40), 0, 360));
    else if (type === "ARC")
      lines.push(arc(one(10), one(20), one(40), one(50), one(51) + (one(51) < one(50) ? 360 : 0)));
    else if (type === "LWPOLYLINE") {
      const points = [];
      for (const [code, value] of codes) {
        if (code === 10) points.push({ at: [Number(value), 0], bulge: 0 });
        else if (code === 20 && points.length) points.at(-1).at[1] = Number(value);
        else if (code === 42 && points.length) points.at(-1).bulge = Number(value);
      }
      if (points.length) join(points, (one(70) & 1) === 1);
    } else if (type === "POLYLINE") [vertices, closed] = [[], (one(70) & 1) === 1];
    else if (type === "VERTEX" && vertices) vertices.push({ at: [one(10), one(20)], bulge: one(42) });
    else if (type === "SEQEND" && vertices) {
      if (vertices.length) join(vertices, closed);
      vertices = null;
    }
  }
  return lines;
}

function fromSvg(content) {
  const parsed = new DOMParser().parseFromString(content, "image/svg+xml");
  if (parsed.querySelector("parsererror")) throw new Error("The file is not valid SVG.");
  // only geometry is copied: nothing of the file gets into the page but the numbers of its shapes
  const host = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  host.setAttribute("class", "hidden");
  document.body.append(host);
  const lines = [];
  for (const shape of parsed.querySelectorAll("path, polygon, polyline, line, rect, circle, ellipse")) {
    const own = document.createElementNS("http://www.w3.org/2000/svg", shape.localName);
    for (const name of [
      "d",
      "points",
      "x",
      "y",
      "x1",
      "y1",
      "x2",
      "y2",
      "width",
      "height",
      "cx",
      "cy",
      "r",
      "rx",
      "ry",
    ])
      if (shape.hasAttribute(name)) own.setAttribute(name, shape.getAttribute(name));
    host.append(own);
    const list = ["polygon", "polyline"].includes(shape.localName) ? [...own.points].map(({ x, y }) => [x, -y]) : [];
    if (shape.localName === "polygon" && list.length) list.push(list[0]);
    const whole = own.getTotalLength();
    if (!list.length && whole > 0)
      list.push(
        ...Array.from({ length: CURVE_POINTS + 1 }, (_, k) => own.getPointAtLength((whole * k) / CURVE_POINTS)).map(
          ({ x, y }) => [x, -y],
        ),
      );
    if (list.length) lines.push(list);
  }
  host.remove();
  return lines;
}

/** The outline in a file's text, by its name's ending. Throws Error where there is none. */
export function readOutline(content, name) {
  const lines = /\.svg$/i.test(name) ? fromSvg(content) : fromDxf(content);
  const points = lines.flat();
  if (!points.length || !points.every((point) => point.every(Number.isFinite)))
    throw new Error("The file has no lines, arcs, circles or polylines that can be read.");
  if (points.length > MOST_POINTS) throw new Error(`The outline has more than ${MOST_POINTS} points.`);
  const [cx, cy] = [0, 1].map((i) => (Math.min(...points.map((p) => p[i])) + Math.max(...points.map((p) => p[i]))) / 2);
  return lines.map((line) => line.map(([x, y]) => [Number((x - cx).toPrecision(6)), Number((y - cy).toPrecision(6))]));
}
