// The chain: its words, units and drawing, with the chain in motion on its track and the slot enlarged.

import { add, along, direction, less, size, times } from "./plane.js";
import { circle, dot, grid, line, path, stage, steps, symbol } from "./stage.js";

const MOST_PINS = 60_000; // in a drawing
const SAMPLES = 91; // of a drawing, unless there are too many pins

const short = (value) => Math.round(value * 100) / 100;

/** SVG path data of a closed contour of rows x, y, bulge: the tangent of a quarter of the turn to the next row. */
function contour(rows, view) {
  const coordinates = ([x, y]) => `${short(view.x(x))} ${short(view.y(y))}`;
  const piece = ([x, y, bulge], k) => {
    const next = rows[(k + 1) % rows.length],
      turn = 4 * Math.atan(bulge);
    if (!bulge) return `L${coordinates(next)}`;
    const chord = size(less(next, [x, y])),
      radius = short((view.scale * chord) / (2 * Math.sin(Math.abs(turn) / 2)));
    return `A${radius} ${radius} 0 ${Math.abs(turn) > Math.PI ? 1 : 0} ${turn > 0 ? 0 : 1} ${coordinates(next)}`;
  };
  return `M${coordinates(rows[0])}${rows.map(piece).join("")}Z`;
}

const outlined = (kind, rows) => rows && path(kind, (view) => contour(rows, view));

/** The wheels of the crescent: centres, and the number of their spokes. */
function wheelsOf({ geometry: g, angle_unit: unit }) {
  const turn = unit === "rad" ? 2 * Math.PI : 360,
    [x, y] = times(along((g.epsilon * 2 * Math.PI) / turn), g.upper_radius + g.wheel_radius),
    spokes = Math.round(turn / g.delta_wheel);
  return [-x, x].map((side) => ({ centre: [side, y], radius: g.wheel_radius, spokes }));
}

/** Spokes of a wheel, of which the first leads to a pin that lies on it. */
function spokesOf({ centre, radius, spokes }, pins) {
  const on = pins.find((pin) => Math.abs(size(less(pin, centre)) - radius) < 1e-3 * radius);
  if (!on) return [];
  const start = direction(less(on, centre));
  return Array.from({ length: spokes }, (_, k) => {
    const tip = add(centre, times(along(start + (2 * Math.PI * k) / spokes), radius));
    return [centre, tip, null];
  }).flat();
}

/** The wheels and arcs of the crescent with their names. */
function crescent(reply) {
  const { geometry: g } = reply,
    wheels = wheelsOf(reply),
    lower = [0, g.eccentricity];
  return [
    ...wheels.map(({ centre, radius }) => circle("wheel", centre, radius)),
    ...wheels.map((wheel) => line("wheel", (pins) => spokesOf(wheel, pins))),
    ...wheels.map(({ centre }) => dot("fixed", centre, 4)),
    dot("fixed", [0, 0], 3),
    dot("fixed", lower, 3),
    ...wheels.map(({ centre }) => symbol("R0", centre, 8, 16)),
    symbol("O1", [0, 0], 8, -4),
    symbol("O2", lower, 8, -4),
    symbol("R1", times(along(-2.2), g.upper_radius), -26, 0),
    symbol("R2", add(lower, times(along(-2), g.lower_radius)), -8, 20),
  ];
}

/** Track, groove, wheels and links; then the slot enlarged. The state of both is the list of pins. */
function drawing(host, reply, follow) {
  const { slot, pins, outline, geometry: g, angle_unit: unit } = reply,
    phases = slot.theta1,
    sign = unit === "rad" ? "rad" : "°",
    free = slot.free_pin - 1,
    state = steps(phases, pins.xy),
    walls = [outline.left, outline.right].map((rows) => outlined("wall", rows)),
    pinAt = (k) => (now) => now.at(k);
  let enlarged = null;
  const run = stage(host, {
    label: `A chain of ${reply.links} links on its track; pin P${slot.free_pin} hangs in the slot`,
    extent: [...pins.xy[0], ...(outline.right ?? outline.path)],
    parts: [
      grid,
      ...walls,
      outlined("ground", outline.path),
      line("curve", slot.xy),
      ...crescent(reply),
      line("link crank thin", (now) => now, true),
      ...pins.xy[0].map((_, k) => (k === free ? dot("point", pinAt(k), 6) : dot("pin", pinAt(k), 4))),
      ...[0, free].map((k) => symbol(`P${k + 1}`, pinAt(k))),
      symbol("slot", slot.xy[Math.floor(slot.xy.length / 2)], -48, 26),
    ],
    state,
    play: { name: "Angle of P1", from: phases[0], to: phases.at(-1), seconds: 3, round: true },
    words: (phase) => `θ1 ${phase.toFixed(sign === "rad" ? 4 : 2)}${sign}`,
    follow(phase) {
      follow(phase);
      enlarged?.go(phase);
    },
  });
  const ends = (pick) => [0, 1].map((i) => pick(...slot.xy.map((point) => point[i]))),
    [low, high] = [ends(Math.min), ends(Math.max)],
    room = Array(2).fill(0.06 * Math.max(...less(high, low)));
  enlarged = stage(host, {
    label: `The slot of pin P${slot.free_pin}, enlarged`,
    extent: [less(low, room), add(high, room)],
    parts: [
      grid,
      ...walls,
      circle("bare", [0, 0], g.upper_radius),
      line("curve", slot.xy),
      line("link crank thin", (now) => [now.at(free - 1), now[free], now[(free + 1) % now.length]]),
      dot("point", pinAt(free), 7),
      symbol(`P${slot.free_pin}`, pinAt(free), 10, 20),
      symbol("R1", slot.xy[Math.round(slot.xy.length / 5)], 4, -18),
    ],
    state,
    value: run.value,
  });
  return run;
}

const ANGLES = /theta|phase|geometry · (alpha|delta|epsilon|xi)/;

export const chain = {
  purpose:
    "A chain of constant pitch runs around a crescent of two arcs with a wheel at each end. Its links are " +
    "chords of the track, so that a shallow slot in the upper arc must take up the slack; the result is the " +
    "shape of this slot.",
  caption:
    "One pin hangs freely between its neighbours in the upper arc, and its path is the shape of the slot. " +
    "All lengths are in the unit of the pitch.",
  over: ["slot · theta1"],
  hidden: /^(pins|outline|angle_unit|geometry · tangency_residual)$/,
  unitOf: (name, { angle_unit: unit }) => (ANGLES.test(name) ? { deg: "°", rad: "rad" }[unit] : ""),
  drawing({ query, request, reply }) {
    const samples = Math.min(SAMPLES, Math.floor(MOST_PINS / reply.links)),
      more = { samples, include: ["pins", "outline"] };
    return [query.path, { ...request, ...more }];
  },
  draw: (host, { drawn }, follow) => drawing(host, drawn, follow),
};
