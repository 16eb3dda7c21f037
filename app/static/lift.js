// The lift's page: cylinder, triangle and platform in motion, its curves, and the optimum design.

import { curves, facts, note, table } from "./answer.js";
import { text } from "./drawing.js";
import { dot, line, path, stage, symbol } from "./stage.js";

const LENGTHS = ["l2", "l3", "l4", "l5", "b"];
const SMOOTH = 201; // times of a drawing's motion: curves through fewer have kinks

const between = ([x, y], [u, v], share = 0.5) => [x + share * (u - x), y + share * (v - y)];

/** The poses at the times of a motion with points, and between them, where time runs evenly. */
function poses({ time, points }) {
  const last = Math.max(0, time.length - 2);
  return (now) => {
    const even = Math.floor(((now - time[0]) / (time.at(-1) - time[0])) * (time.length - 1));
    let k = Math.min(Math.max(0, even), last);
    while (k > 0 && time[k] > now) k--;
    while (k < last && time[k + 1] < now) k++;
    // a slider stops beside its end by rounding
    const share = time.length > 1 ? Math.round((1e9 * (now - time[k])) / (time[k + 1] - time[k])) / 1e9 : 0,
      [A, B, C] = ["A", "B", "C"].map((name) =>
        between(points[name][k], points[name][k + 1] ?? points[name][k], share),
      );
    return { k, share, O: [0, 0], D: points.D, A, B, C };
  };
}

/** Names between two joints of the drawing. */
const SIDES = [
  ["l1", "O", "B"],
  ["l2", "A", "B"],
  ["l3", "A", "C"],
  ["l4", "B", "C"],
  ["l5", "D", "C", 0.2],
];

/** The mechanism in motion: cylinder O-B, triangle A B C, link D-C, platform at A on its slide. */
function drawing(host, moved, follow) {
  const { points, time, height, velocity } = moved,
    state = poses(moved),
    top = Math.max(...height),
    wide = 0.26 * top,
    shut = Math.min(...moved.cylinder_length) * 0.92,
    high = [points.D[0], 1.06 * top];
  const at = (name) => (now) => now[name],
    middle = (from, to, share) => (now) => between(now[from], now[to], share),
    value = (list, { k, share }) => list[k] + share * ((list[k + 1] ?? list[k]) - list[k]);
  const words = (now) => {
    const pose = state(now);
    return `${text(now, 4)} s, height ${text(value(height, pose), 5)} mm, ${text(value(velocity, pose), 4)} mm/s`;
  };
  const parts = [
    path("axis", (view) => `M0 ${view.y(0)}H${view.width}`),
    line("ground", [points.D, high]),
    line("curve turn", points.B),
    line("curve turn", points.C),
    line("body", ({ A, B, C }) => [A, B, C, A]),
    line("link crank tube", ({ O, B }) => [O, between(O, B, Math.min(1, shut / Math.hypot(...B)))]),
    line("link crank", ({ O, B }) => [O, B]),
    line("link rocker", ({ D, C }) => [D, C]),
    line("link platform", ({ A: [x, y] }) => [
      [x - wide, y],
      [x + wide, y],
    ]),
    ...["O", "D", "A", "B", "C"].map((name) => dot("OD".includes(name) ? "fixed" : "pin", at(name), 6)),
    ...["O", "D", "A", "B", "C"].map((name) => symbol(name, at(name))),
    ...SIDES.map(([name, ...ends]) => symbol(name, middle(...ends), 6, -5)),
    symbol("b", middle("O", "D"), 6, 16),
    symbol("s", middle("D", "A"), -16, -5),
  ];
  return stage(host, {
    label: `The lift from height ${text(height[0], 5)} to ${text(height.at(-1), 5)} millimetres`,
    extent: [[0, 0], points.D, high, ...points.A, ...points.B, ...points.C, [points.D[0] - wide, 0]],
    parts,
    state,
    play: { name: "Time", from: time[0], to: time.at(-1), seconds: time.at(-1) - time[0] },
    words,
    follow,
  });
}

const CURVES = [
  ["Height of the platform", "mm", "height"],
  ["Speed of the platform", "mm/s", "velocity"],
  ["Acceleration of the platform", "mm/s²", "acceleration"],
  ["Length of the cylinder", "mm", "cylinder_length"],
];

/** The forces of a reply as curves; what is available is dashed. */
function forceCurves({ forces, time }, pressure) {
  const level = { values: time.map(() => pressure), colour: "box", dash: [6, 4], width: 1.2 },
    colours = { cylinder: "body", link: "path", slide: "pose" },
    series = Object.entries(colours).map(([name, colour]) => ({ values: forces[name], colour })),
    needed = [{ values: forces.pressure, colour: "body" }, level];
  return [
    { title: "Forces of cylinder (blue), link (green), slide (red)", unit: "N", series },
    { title: "Pressure needed (dashed: available)", unit: "bar", series: needed },
  ];
}

/** A motion: drawing and curves that follow one another. */
function motion(moved, hosts, pressure = 6) {
  const list = CURVES.map(([title, unit, name]) => ({ title, unit, values: moved[name] }));
  if (moved.forces) list.push(...forceCurves(moved, pressure));
  return drawing(hosts.picture, moved, curves(hosts.curves, { x: moved.time, xUnit: "s", list }));
}

/** A question for a motion as its drawing needs it: even times, of the whole motion, and points. */
const smooth = ({ times, ...request }) => ({
  ...request,
  samples: Math.max(SMOOTH, request.samples ?? 0),
  include: [...new Set([...(request.include ?? []), "points"])],
});

function motionFacts(host, { forces, ...reply }) {
  facts(host, [
    ["time of the rise", reply.rise_time, "s"],
    ["height at the start", reply.height_start, "mm"],
    ["height at the end", reply.height_end, "mm"],
    ["cylinder at the top", reply.length_top, "mm"],
    ["cylinder at the dead point", reply.dead_point_length, "mm"],
  ]);
  if (!forces) return;
  const rows = [
    ["largest force of the cylinder", forces.cylinder_max, "N"],
    ["smallest force of the cylinder", forces.cylinder_min, "N"],
    ["largest pressure needed", forces.pressure_max, "bar"],
    ["pressure is enough", forces.pressure_is_enough],
    ["smallest bore", forces.bore_min, "mm"],
  ];
  facts(host, rows, "Forces");
}

/** Units of limits that are no lengths. */
const UNITS = { acceleration: "mm/s²", jerk: "mm/s³", rise_time: "s", extension: "", dead_point: "", force_ratio: "" };
const unitOf = (name, angle) => (name === "transmission_angle" ? angle : (UNITS[name] ?? "mm"));
const plain = (name) => name.replaceAll("_", " ");

/** Limits that hold a design, in words: `jerk<=max` is "jerk at most". */
const limitNames = (names) =>
  names?.map((name) => plain(name.replace("<=max", " at most").replace(">=min", " at least")));

/** Show the limits of an optimum with their values, the active limits first. */
function limits(host, { constraints, unconstrained: free, objective_increase: increase }, angle) {
  const rows = constraints
    .toSorted((first, second) => second.active - first.active)
    .map((row) => {
      const sign = row.kind === "minimum" ? "≥" : "≤";
      return [plain(row.name), row.value, sign, row.limit, unitOf(row.name, angle), row.active];
    });
  table(host, "Constraints", ["limit of", "has", "", "limit", "unit", "active"], rows);
  if (!free) return;
  const broken = free.violated.map(({ name, value }) =>
      `${plain(name)} ${text(value, 3)} ${unitOf(name, angle)}`.trim(),
    ),
    outside = broken.length ? `It violates these limits: ${broken.join(", ")}.` : "It satisfies all limits.",
    gain = `${text(Math.abs(100 * increase), 3)} % ${increase < 0 ? "below" : "above"}`;
  const source = `The source's problem, for the same objective, has the optimum ${text(free.objective, 5)}`;
  note(host, `${source}: this one is ${gain}. ${outside}`);
}

const BATCH = [["l1′", "mm"], ["speed", "mm/s"], ...LENGTHS.map((name) => [name, "mm"]), "f"];

function batch({ rows }, hosts) {
  const cells = rows.map((row) => [
    row.cylinder.length,
    row.cylinder.speed,
    ...LENGTHS.map((name) => row.design?.[name]),
    row.objective,
    row.motion?.rise_time,
    limitNames(row.active) ?? row.detail,
  ]);
  table(hosts.tables, "An optimum for each cylinder", [...BATCH, ["rise time", "s"], "held by"], cells);
  return null;
}

async function optimum({ request, reply, ask }, hosts) {
  const unconstrained = reply.unconstrained;
  const designs = unconstrained ? [reply, unconstrained] : [reply],
    beside = unconstrained ? [request.cylinder.length] : [];
  const lengths = LENGTHS.map((name) => [`${name}, mm`, ...designs.map(({ design }) => design[name])]),
    closed = ["closed l1′, mm", reply.closed_length, ...beside],
    objectives = ["objective", ...designs.map(({ objective }) => objective)],
    columns = ["", "optimum", ...(unconstrained ? ["the source's problem"] : [])];
  table(hosts.facts, "Design", columns, [...lengths, closed, objectives]);
  facts(hosts.facts, [
    ["time of the rise", reply.motion.rise_time, "s"],
    ["speed at the start", reply.motion.velocity_start, "mm/s"],
    ["mean speed over height", reply.motion.velocity_mean, "mm/s"],
    ["cylinder at the dead point", reply.motion.dead_point_length, "mm"],
    ["held by", limitNames(reply.active)],
    ["evaluations", reply.evaluations],
  ]);
  note(hosts.facts, reply.note);
  if (reply.constraints) limits(hosts.tables, reply, request.angle_unit === "rad" ? "rad" : "°");
  const cylinder = { ...request.cylinder, length: reply.closed_length };
  return motion(await ask("/v2/lift/motion", smooth({ design: reply.design, cylinder })), hosts);
}

export const lift = {
  request: (query, request) => (query.path === "/v2/lift/motion" && !request.times ? smooth(request) : request),

  async show(answer, hosts) {
    const { query, request, reply, ask } = answer;
    if (query.path === "/v2/lift/batch") return batch(reply, hosts);
    if (query.path !== "/v2/lift/motion") return optimum(answer, hosts);
    motionFacts(hosts.facts, reply);
    const moved = request.times ? await ask(query.path, smooth(request)) : reply;
    return motion(moved, hosts, request.pneumatics?.pressure);
  },
};
