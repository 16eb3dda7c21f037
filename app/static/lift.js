// The lift: its words, units and drawing, with cylinder, triangle and platform in motion.

import { text } from "./drawing.js";
import { between } from "./plane.js";
import { dot, line, path, stage, steps, symbol } from "./stage.js";

const SAMPLES = 201; // times of the drawing: curves through fewer have kinks

/** Names between two joints of the drawing. */
const SIDES = [
  ["l1", "O", "B"],
  ["l2", "A", "B"],
  ["l3", "A", "C"],
  ["l4", "B", "C"],
  ["l5", "D", "C", 0.2],
];

/** The mechanism in motion: cylinder O-B, triangle A B C, link D-C, platform at A on its slide. */
function drawing(host, { points, time, height, velocity, cylinder_length: lengths }, follow) {
  const { A, B, C, D } = points,
    top = Math.max(...height),
    wide = 0.26 * top,
    shut = Math.min(...lengths) * 0.92,
    high = [D[0], 1.06 * top],
    rows = time.map((_, k) => ({ O: [0, 0], D, A: A[k], B: B[k], C: C[k], height: height[k], velocity: velocity[k] }));
  const at = (name) => (now) => now[name],
    middle = (from, to, share) => (now) => between(now[from], now[to], share),
    state = steps(time, rows),
    joints = ["O", "D", "A", "B", "C"];
  const parts = [
    path("axis", (view) => `M0 ${view.y(0)}H${view.width}`),
    line("ground", [D, high]),
    line("curve turn", B),
    line("curve turn", C),
    line("body", (now) => [now.A, now.B, now.C, now.A]),
    line("link crank tube", (now) => [now.O, between(now.O, now.B, Math.min(1, shut / Math.hypot(...now.B)))]),
    line("link crank", (now) => [now.O, now.B]),
    line("link rocker", (now) => [D, now.C]),
    line("link platform", ({ A: [x, y] }) => [
      [x - wide, y],
      [x + wide, y],
    ]),
    ...joints.map((name) => dot("OD".includes(name) ? "fixed" : "pin", at(name), 6)),
    ...joints.map((name) => symbol(name, at(name))),
    ...SIDES.map(([name, from, to, share = 0.5]) => symbol(name, middle(from, to, share), 6, -5)),
    symbol("b", middle("O", "D", 0.5), 6, 16),
    symbol("s", middle("D", "A", 0.5), -16, -5),
  ];
  return stage(host, {
    label: `The lift from height ${text(height[0], 5)} to ${text(height.at(-1), 5)} millimetres`,
    extent: [[0, 0], D, high, ...A, ...B, ...C, [D[0] - wide, 0]],
    parts,
    state,
    play: { name: "Time", from: time[0], to: time.at(-1), seconds: time.at(-1) - time[0] },
    words(now) {
      const { height: reached, velocity: speed } = state(now);
      return `${text(now, 4)} s, height ${text(reached, 5)} mm, ${text(speed, 4)} mm/s`;
    },
    follow,
  });
}

const UNITS = [
  [/pressure/, "bar"],
  [/time/, "s"],
  [/velocity|speed/, "mm/s"],
  [/acceleration/, "mm/s²"],
  [/length|height|bore|design/, "mm"],
  [/^forces ·/, "N"],
];

export const lift = {
  purpose:
    "A pneumatic cylinder pushes a corner of a rigid triangle, and the triangle lifts a platform along a " +
    "vertical slide. Change the lengths, the cylinder and the load; the result is the motion of the platform " +
    "and its forces.",
  caption:
    "A is the platform on its slide, B the end of the cylinder l₁ from the pivot O, and C the end of the " +
    "link l₅ from the pivot D.",
  over: ["time"],
  hidden: /^(points|slacks|angle_unit|angles|angular_\w+|forces · (weight|pivot_.))$/,
  unitOf: (name) => UNITS.find(([pattern]) => pattern.test(name))?.[1] ?? "",
  drawing({ request, reply }) {
    const design = request.design ?? reply.design,
      length = reply.closed_length ?? request.cylinder?.length,
      body = { design, cylinder: { ...request.cylinder, length }, samples: SAMPLES, include: ["points"] };
    return design && ["/v2/lift/motion", body];
  },
  draw: (host, { drawn }, follow) => (drawn.points ? drawing(host, drawn, follow) : null),
};
