// The chain's page: the chain in motion on its track with wheels and slot, and the slot enlarged.

import { curves, facts, note, table } from "./answer.js";
import { add, along, less, size, times } from "./plane.js";
import { seldom } from "./play.js";
import { circle, dot, grid, line, path, stage, steps, symbol } from "./stage.js";

const MOST_PINS = 60_000; // listed in an answer to a drawing
const FEWEST = 46; // samples of a drawing: steps of two degrees of P1 on a wheel of four pins
const USUAL = 91; // samples, unless the request says another
const PARTS = {
  left_wheel: ["crank", "orange"],
  lower_arc: ["body", "blue"],
  right_wheel: ["path", "green"],
  upper_arc: ["pose", "red"],
};
const UNIT = "All lengths are in the unit of the pitch.";

const short = (value) => Math.round(value * 100) / 100;
const clip = (name) => name.replace("_", " ");

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
const walls = (outline) => [outline?.left, outline?.right].map((rows) => outlined("wall", rows));

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
  const start = Math.atan2(on[1] - centre[1], on[0] - centre[0]);
  return Array.from({ length: spokes }, (_, k) => {
    const tip = add(centre, times(along(start + (2 * Math.PI * k) / spokes), radius));
    return [centre, tip, null];
  }).flat();
}

/** Track, groove, wheels and links; the state of the drawing is the list of its pins. */
function machine({ slot: slotCurve, pins, outline, geometry: g, ...reply }) {
  const wheels = wheelsOf({ geometry: g, ...reply }),
    free = slotCurve.free_pin - 1;
  const names = [
    ...wheels.map(({ centre }) => symbol("R0", centre, 8, 16)),
    symbol("O1", [0, 0], 8, -4),
    symbol("O2", [0, g.eccentricity], 8, -4),
    symbol("R1", times(along(-2.2), g.upper_radius), -26, 0),
    symbol("R2", add([0, g.eccentricity], times(along(-2), g.lower_radius)), -8, 20),
  ];
  const centres = [...wheels.map(({ centre }) => [centre, 4]), [[0, 0], 3], [[0, g.eccentricity], 3]];
  return [
    grid(),
    ...wheels.map(({ centre, radius }) => circle("wheel", centre, radius)),
    ...walls(outline),
    outlined("ground", outline?.path),
    line("curve", slotCurve.xy),
    ...wheels.map((wheel) => line("wheel", (pinPoints) => spokesOf(wheel, pinPoints))),
    line("link crank thin", (pinPoints) => pinPoints, true),
    ...pins.xy[0].map((_, k) => dot(k === free ? "point" : "pin", (pinPoints) => pinPoints[k], k === free ? 6 : 4)),
    ...centres.map(([centre, radius]) => dot("fixed", centre, radius)),
    ...[0, free].map((pin) => symbol(`P${pin + 1}`, (pinPoints) => pinPoints[pin])),
    symbol("slot", slotCurve.xy[Math.floor(slotCurve.xy.length / 2)], -48, 26),
    ...names,
  ];
}

/** The slot enlarged, its bare arc and walls, with the free pin and its neighbours. */
function closeUp(host, { slot: slotCurve, outline, geometry }, state) {
  const [xs, ys] = [0, 1].map((i) => slotCurve.xy.map((point) => point[i])),
    [low, high] = [Math.min, Math.max].map((end) => [end(...xs), end(...ys)]),
    room = 0.06 * Math.max(...less(high, low)),
    free = slotCurve.free_pin - 1,
    name = `P${slotCurve.free_pin}`;
  const parts = [
    grid(),
    ...walls(outline),
    circle("bare", [0, 0], geometry.upper_radius),
    line("curve", slotCurve.xy),
    line("link crank thin", (pinPoints) => [
      pinPoints.at(free - 1),
      pinPoints[free],
      pinPoints[(free + 1) % pinPoints.length],
    ]),
    dot("point", (pinPoints) => pinPoints[free], 7),
    symbol(name, (pinPoints) => pinPoints[free], 10, 20),
    symbol("R1", slotCurve.xy[Math.round(slotCurve.xy.length / 5)], 4, -18),
  ];
  const extent = [less(low, [room, room]), add(high, [room, room])];
  return stage(host, { label: `The slot of pin ${name}, enlarged`, extent, parts, state, value: slotCurve.theta1[0] });
}

function slotFacts(host, { slot: slotCurve, checks, geometry: g, fit, ...reply }, angle) {
  facts(host, [
    ["status", reply.status],
    ["depth of the slot", slotCurve.depth_max],
    ["smallest curvature radius", slotCurve.radius_min],
    ["step at the slot's ends", slotCurve.end_step],
    ["largest slack", Math.max(...slotCurve.slack)],
    ["largest chord error", checks.chord_error_max],
    ["stretched", checks.stretched],
    ["roller fits", checks.roller_fits],
  ]);
  const layout = [
    ["R0", g.wheel_radius],
    ["R1", g.upper_radius],
    ["R2", g.lower_radius],
    ["b", g.eccentricity],
    ["ξ", g.xi, angle],
    ["α", g.alpha, angle],
    ["start of the window", g.phase_start, angle],
    ["wheels out of phase by", reply.wheel_phase_conflict, angle],
  ];
  facts(host, layout, "Layout");
  const fitted = fit && [
    ["order", fit.order],
    ["error square to the slot", fit.max_normal],
    ["error of a link", fit.max_chord],
  ];
  if (fitted) facts(host, fitted, "Fit");
  note(host, UNIT);
}

/** The angles of all pins over the phase, in the colours of the parts of the track; returns what marks a phase. */
function angleCurves(host, { pins, slot: slotCurve }, phases, angle) {
  const pieces = pins.theta[0].flatMap((_, pin) =>
    pins.segments.map((part, n) => ({
      values: pins.theta.map((row, j) => (pins.segment[j][pin] === n ? row[pin] : null)),
      colour: PARTS[part][0],
      width: pin + 1 === slotCurve.free_pin ? 3 : 1.4,
    })),
  );
  const series = pieces.filter(({ values }) => values.some((value) => value !== null)),
    parts = pins.segments.map((part) => `${clip(part)} (${PARTS[part][1]})`).join(", ");
  const angles = `Angles θ1 … θ${pins.theta[0].length} of the pins`,
    title = `${angles} on the ${parts}, ${angle}; thick: P${slotCurve.free_pin}`;
  return curves(host, { x: phases, xUnit: angle, list: [{ title, height: 320, series }] });
}

/** Show a reply; `drawing` is the same reply with pins and outline. */
function slot(reply, drawing, hosts) {
  const { slot: slotCurve } = reply,
    { pins, outline } = drawing,
    angle = reply.angle_unit === "rad" ? "rad" : "°",
    phases = drawing.slot.theta1;
  slotFacts(hosts.facts, reply, angle);
  const crossings = reply.crossings.map(({ theta1, pin, to }) => [theta1, `P${pin}`, clip(to)]);
  const title = "Pins that pass a joint: the slot's curvature jumps";
  table(hosts.tables, title, [["θ1", angle], "pin", "onto"], crossings);
  const slack = [{ title: "Slack at the free pin", values: slotCurve.slack, colour: "path" }],
    marks = [
      curves(hosts.curves, { x: slotCurve.theta1, xUnit: angle, list: slack }),
      angleCurves(hosts.curves, drawing, phases, angle),
    ];
  const between = (k, share) =>
      pins.xy[k].map((point, pin) => add(point, times(less(pins.xy[k + 1][pin], point), share))),
    state = steps(phases, between),
    mark = seldom((phase) => marks.forEach((setMark) => setMark(phase)));
  let beside = null;
  const run = stage(hosts.picture, {
    label: `A chain of ${reply.links} links on its track; pin P${slotCurve.free_pin} hangs in the slot`,
    extent: [...pins.xy[0], ...(outline.right ?? outline.path)],
    parts: machine(drawing),
    state,
    play: { name: "Angle of P1", from: phases[0], to: phases.at(-1), seconds: 3, round: true },
    words: (phase) => `θ1 ${phase.toFixed(angle === "rad" ? 4 : 2)}${angle}`,
    follow: (phase) => {
      mark(phase);
      beside?.go(phase);
    },
  });
  beside = closeUp(hosts.picture, drawing, state);
  run.go(run.value);
  return run;
}

/** A question as its drawing needs it. */
const drawable = (request, samples) => ({ ...request, samples, include: ["pins", "outline"] });

export const chain = {
  request(query, request) {
    const samples = Math.max(request.samples ?? USUAL, FEWEST);
    return samples * request.links > MOST_PINS ? request : drawable(request, samples);
  },
  numbers: ({ pins, outline, ...reply }) => reply,
  async show({ query, request, reply, ask }, hosts) {
    if (reply.pins && reply.outline) return slot(reply, reply, hosts);
    const samples = Math.min(USUAL, Math.floor(MOST_PINS / reply.links)),
      bare = { ...request, fit: null };
    return slot(reply, await ask(query.path, drawable(bare, samples)), hosts);
  },
};
