// The knotter's page: disc, bill, jaw and rope in space, the crossings in their planes, and the verdicts.

import { curves, facts, note, scrolling, table } from "./answer.js";
import { element, tableOf, text } from "./drawing.js";
import { seldom } from "./play.js";
import { build } from "./shell.js";
import { along, circle, Projection } from "./space.js";
import { dot, grid, line, stage, steps, symbol } from "./stage.js";

const MOST_CELLS = 400;
const FAR = 2.2; // sizes of a triangle within which a crossing is drawn
const CONDITIONS = ["wrap", "clearance", "bite"];
const degree = (unit) => (unit === "rad" ? "rad" : "°");
const ROPE = {
  wrap: ["The rope wraps", "The rope does not wrap"],
  bite: ["The jaw bites the rope", "The jaw does not bite the rope"],
};

/** Return a verdict as a sentence. */
function sentence(name, part, unit) {
  const { worst_angle: worst } = part;
  const margin = `${text(Math.abs(part.margin), 4)} mm ${part.holds ? "to spare" : "short"}`,
    at = (angle) => `at ${text(angle, 5)}${unit}`;
  if (name === "clearance")
    return `S10 ${part.holds ? "keeps clear of the disc" : "meets the disc's plane"}, ${margin} ${at(worst)}`;
  const [good, bad] = ROPE[name];
  if (part.angle === null) return `${bad}: it never enters the triangle, ${margin} ${at(part.nearest_angle)}`;
  const where = `${at(part.angle)}${part.edge ? ` through ${part.edge}` : ""}`;
  return part.holds ? `${good} ${where}, ${margin}` : `${bad}: it enters ${where}, ${margin}`;
}

function verdict(host, reply, unit) {
  const rows = CONDITIONS.map((name) => {
    const part = reply[name],
      sign = element("strong", "", `${part.holds ? "✓" : "✗"} ${name}: `);
    return element("li", part.holds ? "yes" : "no", sign, `${sentence(name, part, unit)}.`);
  });
  host.append(element("ul", "verdicts-list", ...rows));
}

/** The point at which a rope enters a triangle; none where it does not. */
const entryOf = ({ angle, edge, fraction, holds }, name) =>
  angle !== null && edge
    ? [{ name, ends: edge.match(/[A-Z]\d+/g), fraction, kind: holds ? "enter" : "enter wrong" }]
    : [];
const AXES = { shaft: "i1", disc: "j2", bill: "k0" };

/** The mechanism in space; returns its player. */
function space(host, reply, unit, follow) {
  const projection = new Projection(),
    { axes, paths, alpha } = reply,
    turn = unit === "rad" ? 2 * Math.PI : 360;
  const rim = axes ? circle(paths.S0[0], axes.disc) : paths.S0,
    points = Object.values(paths).flat().concat(rim),
    sides = [0, 1, 2].map((k) => points.map((point) => point[k])),
    centre = sides.map((values) => (Math.min(...values) + Math.max(...values)) / 2),
    away = (point) => point.map((value, k) => value - centre[k]),
    reach = Math.max(...points.map((point) => Math.hypot(...away(point)))),
    flat = (point) => projection.at(away(point));
  const state = steps(alpha, (k, share) => {
    const entries = Object.entries(paths).map(([name, path]) => [name, along(path[k], path[k + 1], share)]);
    return Object.fromEntries(entries);
  });
  const lie =
      (...names) =>
      (now) =>
        names.map((name) => flat(now[name])),
    at = (name) => (now) => flat(now[name]),
    idle = (biting) => (now) => (((now.alpha % turn) + turn) % turn > turn / 2 === biting ? "rope" : "rope idle"),
    shafts = Object.entries(axes ?? {}).map(([name, ends]) => [AXES[name], ends]),
    tip = ([start, end], share) => flat(along(start, end, share * reach * 0.5)),
    marks = [...entryOf(reply.wrap, "E1"), ...entryOf(reply.bite, "E2")],
    entry =
      ({ ends: [from, to], fraction }) =>
      (now) =>
        flat(along(now[from], now[to], fraction));
  const parts = [
    ...shafts.map(([, ends]) => line("axis", () => [tip(ends, -1.1), tip(ends, 1.1)])),
    line("disc", () => rim.map(flat)),
    line("curve turn", () => paths.S10.map(flat)),
    line("body", lie("S3", "S4", "S5"), true),
    line("jaw", lie("O5", "S8", "S9"), true),
    line("edge bill", lie("S3", "S4")),
    line("edge jaws", lie("S8", "S9")),
    line("bare", lie("S5", "O5")),
    line(idle(false), lie("S0", "S1")),
    line(idle(true), lie("S0", "S7")),
    ...["S0", "S1", "S7", "S10"].map((name) => dot(name === "S0" ? "fixed" : "pin", at(name))),
    ...marks.map((marker) => dot(marker.kind, entry(marker), 9)),
    ...marks.map((marker) => symbol(marker.name, entry(marker), 12, 14)),
    ...["S0", "S1", "S3", "S4", "S7", "S8", "S9", "S10"].map((name) => symbol(name, at(name))),
    ...shafts.map(([name, ends]) => symbol(name, () => tip(ends, 1.1), 4, -4)),
  ];
  const corner = [0.8 * reach, 0.6 * reach],
    directions = `alpha1 ${text(reply.alpha1, 5)}, alpha3 ${text(reply.alpha3, 5)}`;
  const run = stage(host, {
    label: `The knotter at ${directions}: disc, bill, jaw and rope in space`,
    extent: [corner.map((value) => -value), corner],
    parts,
    state: (value) => ({ ...state(value), alpha: value }),
    play: { name: "Bill angle alpha", from: alpha[0], to: alpha.at(-1), seconds: 6, round: true },
    words: (value) => `alpha ${value.toFixed(unit === "rad" ? 3 : 1)}${unit}`,
    follow,
  });
  projection.control(host, host.querySelector("svg.stage"), () => run.go(run.value));
  return run;
}

/** The crossing in the plane of its triangle (figure 9 of the source), with its way over the bill's angle. */
function plane(host, { alpha, ...reply }, name, judgement) {
  const { point, on_rope: on, corners, frame, triangle } = reply[name],
    [right, up, kind, edge] = name === "E1" ? [1, 2, "body", "edge bill"] : [0, 2, "jaw", "edge jaws"],
    at = (xyz) => [xyz[right], xyz[up]],
    near = judgement.angle ?? judgement.nearest_angle,
    away = (k) => Math.abs(alpha[k] - near),
    closest = [...alpha.keys()].reduce((best, k) => (away(k) < away(best) ? k : best));
  const shape = corners[closest].map(at),
    distance = (p, q) => Math.hypot(p[0] - q[0], p[1] - q[1]),
    size = Math.max(...shape.flatMap((p) => shape.map((q) => distance(p, q)))),
    middle = [0, 1].map((k) => shape.reduce((sum, p) => sum + p[k], 0) / 3),
    trace = point.map((p, k) => (p && on[k] && distance(at(p), middle) < FAR * size ? at(p) : null));
  const state = (value) => {
    const share = ((value - alpha[0]) / (alpha.at(-1) - alpha[0])) * (alpha.length - 1),
      k = Math.min(alpha.length - 1, Math.max(0, Math.round(share)));
    return { way: trace[k], held: corners[k].map(at) };
  };
  const edgeStart = name === "E1" ? 0 : 1,
    beside = (n) => (n === 2 ? [-24, 14] : [9, -8]),
    entered = judgement.point && at(judgement.point);
  const parts = [
    grid("mm"),
    line(kind, ({ held }) => held, true),
    line("curve", trace),
    line(edge, ({ held }) => held.slice(edgeStart, edgeStart + 2)),
    dot("point", (now) => now.way, 6),
    entered && dot(judgement.holds ? "enter" : "enter wrong", entered, 9),
    entered && symbol(name, entered, 12, 4),
    ...triangle.map((corner, n) => symbol(corner, ({ held }) => held[n], ...beside(n))),
  ];
  const spread = (p) => p.map((value, k) => value + 0.12 * (value - middle[k])),
    label = `${name} in the plane ${"ijk"[right]} ${"ijk"[up]} of ${frame}`;
  return stage(host, { label, extent: corners.flat().map(at).map(spread), parts, state, value: near });
}

const assumed = (reply) => `Assumed and not published: ${reply.assumed.join(", ") || "nothing"}.`;

function pair({ reply, request }, hosts) {
  const unit = degree(request.angle_unit),
    { wrap, bite, alpha } = reply,
    followers = [],
    run = space(hosts.picture, reply, unit, (value) => followers.forEach((show) => show(value)));
  verdict(hosts.picture, reply, unit);
  const halves = [build("div"), build("div")];
  hosts.picture.append(element("div", "planes", ...halves));
  followers.push(plane(halves[0], reply, "E1", wrap).go, plane(halves[1], reply, "E2", bite).go);
  facts(hosts.facts, [
    ["status", reply.status],
    ["alpha1", reply.alpha1, unit],
    ["alpha3", reply.alpha3, unit],
    ...CONDITIONS.map((name) => [`margin of the ${name}`, reply[name].margin, "mm"]),
  ]);
  note(hosts.facts, assumed(reply));
  const crossing = (name, first, second, title) => {
    const { point, on_rope: on } = reply[name],
      of = (k) => point.map((p, n) => (p && on[n] ? p[k] : null));
    const series = [
      { values: of(first), colour: "crank" },
      { values: of(second), colour: "body" },
    ];
    return on.some(Boolean) ? [{ title, unit: "mm", series }] : [];
  };
  const list = [
    ...crossing("E1", 1, 2, "E1 along j4 (first) and k4 over alpha"),
    ...crossing("E2", 0, 2, "E2 along i5 (first) and k5 over alpha"),
    { title: "Turn of the disc, beta", unit, values: reply.beta, colour: "path" },
    { title: "Turn of the jaw, alpha4", unit, values: reply.alpha4, colour: "pose" },
  ];
  followers.push(seldom(curves(hosts.curves, { x: alpha, xUnit: unit, list })));
  run.go(wrap.angle ?? run.value);
  return run;
}

const CELLS =
  "Where further parameters vary, the combination with the largest margin is shown. " +
  "The numbers are margins; positive if the condition holds.";

/** A table of verdicts over the first two axes; of more than `MOST_CELLS` cells a list. */
function verdicts(host, { axes, pairs }) {
  const [first, second] = axes,
    value = (entry, axis) => entry[axis] ?? entry.parameters?.[axis],
    [rows, columns] = [first, second].map((axis) => [...new Set(pairs.map((entry) => value(entry, axis)))]);
  if (rows.length * columns.length > MOST_CELLS) {
    const cells = pairs.map((entry) => {
      const margins = CONDITIONS.map((name) => entry[name]?.margin);
      return [...axes.map((axis) => value(entry, axis)), entry.feasible, ...margins];
    });
    table(host, "Margins, positive if the condition holds", [...axes, "ties", ...CONDITIONS], cells);
    return;
  }
  const best = (row, column) =>
    pairs
      .filter((entry) => value(entry, first) === row && value(entry, second) === column)
      .reduce((a, b) => (b.margin > a.margin ? b : a));
  const words = (entry) => {
    const parts = CONDITIONS.filter((name) => entry[name]).map((name) => {
      const { holds, margin } = entry[name];
      return [`${holds ? "✓" : "✗"} ${name} ${text(margin, 3)}`, build("br")];
    });
    return [element("strong", "", entry.feasible ? "ties" : "fails"), ...parts.flat()];
  };
  const pick = rows.map((row) => columns.map((column) => best(row, column))),
    cells = pick.map((row, k) => [text(rows[k], 5), ...row.map(words)]),
    verdictTable = tableOf([`${first} \\ ${second}`, ...columns.map((column) => text(column, 5))], cells, true);
  verdictTable.className = "verdicts";
  for (const [k, cell] of verdictTable.querySelectorAll("td").entries())
    cell.className = pick.flat()[k].feasible ? "yes" : "no";
  verdictTable.prepend(element("caption", "note", `Rows vary ${first}, columns ${second}. ${CELLS}`));
  scrolling(host, "Verdicts", verdictTable);
}

function scan({ reply }, { facts: figures, tables }) {
  verdicts(tables, reply);
  facts(figures, [
    ["status", reply.status],
    ["pairs that tie the knot", `${reply.feasible.length} of ${reply.pairs.length}`],
  ]);
  note(figures, assumed(reply));
}

function needle({ reply, request }, { facts: figures }) {
  const unit = degree(request.angle_unit);
  facts(figures, [
    ["status", reply.status],
    ["L, needle to the jaw's cam", reply.clearance, "mm"],
    ["alpha2 with L above 0", reply.alpha2_range, unit],
    ["smallest whole degree", reply.alpha2_whole_degrees, "°"],
    ["largest L", reply.clearance_max, "mm"],
    ["at alpha2", reply.clearance_max_angle, unit],
    ["d5 required by equation 5", reply.d5, "mm"],
    ["alpha2 for the requested d5", reply.alpha2_for_d5, unit],
  ]);
}

const SHOWN = { curves: pair, scan, needle };

const withoutCurves = ({ point, path, corners, on_rope, inside, ...crossing }) => crossing;

export const knotter = {
  numbers: ({ paths, E1, E2, ...reply }) =>
    paths ? { ...reply, E1: withoutCurves(E1), E2: withoutCurves(E2) } : reply,
  show: (answer, hosts) => SHOWN[answer.query.path.split("/").at(-1)](answer, hosts) ?? null,
};
