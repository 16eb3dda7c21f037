// The outline of a body from an SVG or a DXF file: polylines with y up, from the middle of their extent.

import { make } from "./drawing.js";
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
    radius = chord / (2 * Math.sin(Math.abs(angle) / 2)),
    away = (radius * Math.cos(angle / 2) * Math.sign(bulge)) / (chord || 1),
    [cx, cy] = [(x0 + x1) / 2 - away * (y1 - y0), (y0 + y1) / 2 + away * (x1 - x0)],
    first = Math.atan2(y0 - cy, x0 - cx) / RAD;
  return arc(cx, cy, radius, first, first + angle / RAD).slice(1);
}

/** The polyline through vertices {at, bulge}. */
function joined(vertices, isClosed) {
  const nexts = [...vertices.slice(1), ...(isClosed ? vertices.slice(0, 1) : [])];
  return [vertices[0].at, ...nexts.flatMap(({ at }, k) => bulged(vertices[k].at, at, vertices[k].bulge))];
}

/** Entities of a DXF text: [type, codes], where codes are pairs [code, value], and the values of code 8 are names. */
function entities(content) {
  const rows = content.split(/\r\n|\r|\n/).map((row) => row.trim()),
    found = [];
  let inside = false;
  for (let k = 0; k + 1 < rows.length; k += 2) {
    const code = Number(rows[k]),
      value = rows[k + 1];
    if (code === 2 && value === "ENTITIES") inside = true;
    else if (code === 0 && value === "ENDSEC") inside = false;
    else if (inside && code === 0) found.push([value, []]);
    else if (inside && found.length) found.at(-1)[1].push([code, code === 8 ? value : Number(value)]);
  }
  return found;
}

/** The contours of a DXF text: rows {layer, line}, where the line is a polyline. */
export function contoursOf(content) {
  const found = [];
  let vertices = [],
    closed = false;
  for (const [type, codes] of entities(content)) {
    const valueAt = (code) => codes.find(([at]) => at === code)?.[1] ?? 0,
      point = (code) => [valueAt(code), valueAt(code + 10)],
      [x, y] = point(10),
      add = (line) => found.push({ layer: valueAt(8), line });
    if (type === "LINE") add([[x, y], point(11)]);
    else if (type === "CIRCLE") add(arc(x, y, valueAt(40), 0, 360));
    else if (type === "ARC")
      add(arc(x, y, valueAt(40), valueAt(50), valueAt(51) + (valueAt(51) < valueAt(50) ? 360 : 0)));
    else if (type === "POLYLINE") [vertices, closed] = [[], (valueAt(70) & 1) === 1];
    else if (type === "VERTEX") vertices.push({ at: [x, y], bulge: valueAt(42) });
    else if (type === "SEQEND" && vertices.length) add(joined(vertices, closed));
    else if (type === "LWPOLYLINE") {
      const points = [];
      for (const [code, value] of codes) {
        if (code === 10) points.push({ at: [value, 0], bulge: 0 });
        else if (code === 20 && points.length) points.at(-1).at[1] = value;
        else if (code === 42 && points.length) points.at(-1).bulge = value;
      }
      if (points.length) add(joined(points, (valueAt(70) & 1) === 1));
    }
  }
  return found;
}

const SHAPES = "path, polygon, polyline, line, rect, circle, ellipse";
const GEOMETRY = "d points x y x1 y1 x2 y2 width height cx cy r rx ry".split(" ");

function fromSvg(content) {
  const parsed = new DOMParser().parseFromString(content, "image/svg+xml");
  if (parsed.querySelector("parsererror")) throw new Error("The file is not valid SVG.");
  // only geometry is copied: nothing of the file gets into the page but the numbers of its shapes
  const host = make("svg", { class: "hidden" }, document.body);
  const lines = [...parsed.querySelectorAll(SHAPES)].map((shape) => {
    const kind = shape.localName,
      names = GEOMETRY.filter((name) => shape.hasAttribute(name)),
      own = make(kind, Object.fromEntries(names.map((name) => [name, shape.getAttribute(name)])), host),
      perimeter = own.getTotalLength(),
      even = Array.from({ length: perimeter > 0 ? CURVE_POINTS + 1 : 0 }, (_, k) => (perimeter * k) / CURVE_POINTS),
      points =
        kind.startsWith("poly") && own.points.length ? [...own.points] : even.map((at) => own.getPointAtLength(at));
    if (kind === "polygon" && own.points.length) points.push(points[0]);
    return points.map(({ x, y }) => [x, -y]);
  });
  host.remove();
  return lines.filter((line) => line.length);
}

/** The outline in a file's text, by its name's ending. Throws Error where there is none. */
export function readOutline(content, name) {
  const lines = /\.svg$/i.test(name) ? fromSvg(content) : contoursOf(content).map(({ line }) => line);
  const points = lines.flat();
  if (!points.length || !points.every((point) => point.every(Number.isFinite)))
    throw new Error("The file has no lines, arcs, circles or polylines that can be read.");
  if (points.length > MOST_POINTS) throw new Error(`The outline has more than ${MOST_POINTS} points.`);
  const [cx, cy] = [0, 1].map((i) => (Math.min(...points.map((p) => p[i])) + Math.max(...points.map((p) => p[i]))) / 2);
  return lines.map((line) => line.map(([x, y]) => [Number((x - cx).toPrecision(6)), Number((y - cy).toPrecision(6))]));
}
