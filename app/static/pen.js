// A way drawn by hand: the trace of the pointer, thinned to points that are evenly spaced along it.

import { make, put } from "./drawing.js";

/** Number of points of a drawn path; a short path has fewer. */
export const PATH_POINTS = 24;

const APART = 4; // pixels between points
const TAP = 12; // pixels: a shorter trace is a tap
const NEAR = 16; // pixels between the ends of a way that counts as closed, or this share of how far it goes
const NEAR_SHARE = 0.2;

/** The length of the way up to each point. */
function lengths(points) {
  let total = 0;
  return points.map(([x, y], k) => (k ? (total += Math.hypot(x - points[k - 1][0], y - points[k - 1][1])) : 0));
}

/** `count` points evenly along a polyline, its ends included; of a closed one the last is left out. */
function thin(points, count, closed = false) {
  const path = closed ? [...points, points[0]] : points,
    at = lengths(path);
  const step = at.at(-1) / (closed ? count : count - 1);
  let k = 1;
  return Array.from({ length: count }, (_, n) => {
    const target = Math.min(n * step, at.at(-1));
    while (k < path.length - 1 && at[k] < target) k++;
    const share = at[k] > at[k - 1] ? (target - at[k - 1]) / (at[k] - at[k - 1]) : 0;
    return [0, 1].map((i) => path[k - 1][i] + share * (path[k][i] - path[k - 1][i]));
  });
}

/** The trace of one drag, in pixels, drawn into `layer` while it grows. */
export class Pen {
  constructor(layer, px, py) {
    this.points = [[px, py]];
    this.line = make("path", { class: "pen" }, layer);
  }

  move(px, py) {
    const [x, y] = this.points.at(-1);
    if (Math.hypot(px - x, py - y) < 2) return;
    this.points.push([px, py]);
    put(this.line, { d: `M${this.points.map((point) => point.join(" ")).join("L")}` });
  }

  /** {points, closed} of the finished trace: one point for a tap. */
  end() {
    this.line.remove();
    const { points } = this,
      length = lengths(points).at(-1),
      [first] = points,
      away = points.map(([x, y]) => Math.hypot(x - first[0], y - first[1]));
    if (length < TAP) return { points: [first], closed: false };
    const closed = length > 8 * NEAR && away.at(-1) < Math.max(NEAR, NEAR_SHARE * Math.max(...away));
    return { points: thin(points, Math.min(PATH_POINTS, Math.floor(length / APART)), closed), closed };
  }
}
