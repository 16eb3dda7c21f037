// A view of points in space: parallel projection from a direction that is chosen or turned by dragging.

import { build } from "./shell.js";

/** Directions: [name, turn about the upright axis, tilt] in radians; the first is the one that is shown. */
const DIRECTIONS = [
  ["oblique", 0.7, 0.42],
  ["along i1: plane j1 k1", Math.PI / 2, 0],
  ["along j1: plane i1 k1", 0, 0],
  ["along k1: plane i1 j1", 0, Math.PI / 2],
];

const RADIANS_PER_PIXEL = 0.008;

/** A projection to [right, up]; `turn` and `tilt` may be set. The upright axis is the third. */
export class Projection {
  constructor() {
    [, this.turn, this.tilt] = DIRECTIONS[0];
  }

  at([x, y, z]) {
    const [c, s] = [Math.cos(this.turn), Math.sin(this.turn)],
      away = -s * x + c * y;
    return [c * x + s * y, Math.cos(this.tilt) * z + Math.sin(this.tilt) * away];
  }

  /** The directions as a menu in `host`, and dragging on `svg`; `changed` is called after each turn. */
  control(host, svg, changed) {
    const menu = build("select", {}, ...DIRECTIONS.map(([name]) => new Option(name)), new Option("as turned"));
    let from = null;
    menu.options[DIRECTIONS.length].hidden = true;
    menu.onchange = () => {
      [, this.turn, this.tilt] = DIRECTIONS[menu.selectedIndex] ?? [null, this.turn, this.tilt];
      changed();
    };
    host.append(build("label", { className: "view-choice" }, "View, or drag the drawing", menu));
    svg.classList.add("turns");
    svg.onpointerdown = (event) => {
      from = [event.clientX, event.clientY];
      svg.setPointerCapture(event.pointerId);
    };
    svg.onpointermove = ({ clientX, clientY }) => {
      if (!from) return;
      const tilt = this.tilt + RADIANS_PER_PIXEL * (clientY - from[1]);
      this.turn -= RADIANS_PER_PIXEL * (clientX - from[0]);
      this.tilt = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, tilt));
      from = [clientX, clientY];
      menu.selectedIndex = DIRECTIONS.length;
      changed();
    };
    svg.onpointerup = svg.onpointercancel = () => (from = null);
  }
}

const minus = ([a, b, c], [x, y, z]) => [a - x, b - y, c - z];
const cross = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x];
const unit = (v) => {
  const size = Math.hypot(...v);
  return v.map((x) => x / size);
};

/** Points of the circle through `point` about the axis of two points. */
export function circle(point, [start, end], count = 72) {
  const axis = unit(minus(end, start)),
    to = minus(point, start),
    height = to.reduce((sum, x, k) => sum + x * axis[k], 0);
  const centre = start.map((x, k) => x + height * axis[k]),
    arm = minus(point, centre),
    side = cross(axis, arm);
  return Array.from({ length: count + 1 }, (_, n) => {
    const t = (2 * Math.PI * n) / count;
    return centre.map((x, k) => x + Math.cos(t) * arm[k] + Math.sin(t) * side[k]);
  });
}
