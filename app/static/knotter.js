// The knotter: its words, units and drawing, with disc, bill, jaw and rope in space, and its conditions in sentences.

import { element, text } from "./drawing.js";
import { between } from "./plane.js";
import { build } from "./shell.js";
import { circle, Projection } from "./space.js";
import { dot, line, stage, steps, symbol } from "./stage.js";

const CONDITIONS = {
  wrap: ["The rope wraps", "The rope does not wrap"],
  clearance: ["S10 keeps clear of the disc", "S10 meets the disc's plane"],
  bite: ["The jaw bites the rope", "The jaw does not bite the rope"],
};

/** The conditions of a knot in sentences: whether each holds, where, and with what margin. */
function verdicts(reply, unit) {
  const rows = Object.entries(CONDITIONS).map(([name, [good, bad]]) => {
    const { holds, margin, edge, ...angles } = reply[name],
      angle = angles.angle ?? angles.nearest_angle ?? angles.worst_angle,
      where = `at ${text(angle, 5)}${unit}${edge ? ` through ${edge}` : ""}`,
      room = `${text(Math.abs(margin), 4)} mm ${holds ? "to spare" : "short"}`,
      sign = element("strong", "", `${holds ? "✓" : "✗"} ${name}: `);
    return element("li", holds ? "yes" : "no", sign, `${holds ? good : bad} ${where}, ${room}.`);
  });
  return build("ul", { className: "verdicts-list" }, rows);
}

/** The point at which a rope enters a triangle; none where it does not. */
const entryOf = ({ angle, edge, fraction, holds }, name) =>
  angle !== null && edge
    ? [{ name, ends: edge.match(/[A-Z]\d+/g), fraction, kind: holds ? "enter" : "enter wrong" }]
    : [];
const AXES = { shaft: "i1", disc: "j2", bill: "k0" };

/** The mechanism in space; returns its player. */
function drawing(host, reply, unit, follow) {
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
  const states = alpha.map((value, k) => ({
    alpha: value,
    ...Object.fromEntries(Object.entries(paths).map(([name, way]) => [name, way[k]])),
  }));
  const at = (name) => (now) => flat(now[name]),
    through = (names) => (now) => names.split(" ").map((name) => flat(now[name])),
    isBiting = (now) => ((now.alpha % turn) + turn) % turn > turn / 2,
    rope = (biting) => (now) => (isBiting(now) === biting ? "rope" : "rope idle"),
    shafts = Object.entries(axes ?? {}).map(([name, ends]) => [AXES[name], ends]),
    tip = ([start, end], share) => flat(between(start, end, share * reach * 0.5)),
    marks = [...entryOf(reply.wrap, "E1"), ...entryOf(reply.bite, "E2")],
    entry = (mark) => (now) => flat(between(now[mark.ends[0]], now[mark.ends[1]], mark.fraction));
  const parts = [
    ...shafts.map(([, ends]) => line("axis", () => [tip(ends, -1.1), tip(ends, 1.1)])),
    line("disc", () => rim.map(flat)),
    line("curve turn", () => paths.S10.map(flat)),
    line("body", through("S3 S4 S5"), true),
    line("jaw", through("O5 S8 S9"), true),
    line("edge bill", through("S3 S4")),
    line("edge jaws", through("S8 S9")),
    line("bare", through("S5 O5")),
    line(rope(false), through("S0 S1")),
    line(rope(true), through("S0 S7")),
    ...["S0", "S1", "S7", "S10"].map((name) => dot(name === "S0" ? "fixed" : "pin", at(name))),
    ...marks.map((mark) => dot(mark.kind, entry(mark), 9)),
    ...marks.map((mark) => symbol(mark.name, entry(mark), 12, 14)),
    ...["S0", "S1", "S3", "S4", "S7", "S8", "S9", "S10"].map((name) => symbol(name, at(name))),
    ...shafts.map(([name, ends]) => symbol(name, () => tip(ends, 1.1), 4, -4)),
  ];
  const corner = [0.8 * reach, 0.6 * reach];
  const run = stage(host, {
    label: `The knotter at alpha1 ${text(reply.alpha1, 5)}, alpha3 ${text(reply.alpha3, 5)}: disc, bill, jaw and rope`,
    extent: [corner.map((value) => -value), corner],
    parts,
    state: steps(alpha, states),
    play: { name: "Bill angle alpha", from: alpha[0], to: alpha.at(-1), seconds: 6, round: true },
    words: (value) => `alpha ${value.toFixed(unit === "rad" ? 3 : 1)}${unit}`,
    follow,
  });
  projection.control(host, host.querySelector("svg.stage"), () => run.go(run.value));
  run.go(reply.wrap.angle ?? run.value);
  return run;
}

const degree = (unit) => (unit === "rad" ? "rad" : "°");
const HIDDEN = {
  whole: "E1|E2|axes|paths|feasible|alpha2_for_d5_all|published|partly_published|from_request|frames?|report",
  parts: "nearest_case|point|entered_by|fraction|windows|exit_angle|per_[a-z]+",
};

export const knotter = {
  purpose:
    "The knotter of a baler ties a rope with a disc that holds it and a bill that turns it into a loop. " +
    "Change the directions of both axes, alpha1 and alpha3; the result says whether the knot is tied, and " +
    "with which margins.",
  caption:
    "S₀ is the point of the disc that holds the rope, and S₁ the point where the needle lays it; the rope " +
    "crosses the bill at E₁ and the edge S₈S₉ of the jaw at E₂.",
  over: ["alpha"],
  hidden: new RegExp(`^(${HIDDEN.whole})$|(${HIDDEN.parts})$|^pairs · [a-z]+ · status$`),
  unitOf: (name, _, { angle_unit: unit }) =>
    /alpha|beta|angle/.test(name)
      ? degree(unit)
      : /(clearance|clearance_max|margin|value|worst|d5)$/.test(name)
        ? "mm"
        : "",
  draw(host, { request, reply }, follow) {
    if (!reply.paths) return null;
    const unit = degree(request.angle_unit),
      run = drawing(host, reply, unit, follow);
    host.append(verdicts(reply, unit));
    return run;
  },
};
