// The limits of a motion that a linkage satisfies, as margins that a refinement keeps from becoming negative.

import { SIGNS } from "./kinematics.js";
import { Misfit } from "./misfit.js";
import { PRESET, familyOf } from "./motion.js";
import { RAD, direction, less, size } from "./plane.js";
import { limitName } from "./verdict.js";

const LINKS = ["crank", "coupler", "rocker", "ground"];
/** How far within a limit a linkage is put, as a fraction of the motion's size or in radians. */
export const INSIDE = 1e-5;
/** Limits without a field in the form that the page computes. */
const COMPUTED = ["links", "pivot_a", "pivot_b", "pivot_a_box", "pivot_b_box"];
const SLACK = 1e-6; // by which a limit may be missed, as a fraction of the motion's size or in radians
const GRID = 360; // steps of the used interval at which the transmission angle is looked at
const CHANGE = 1e-3; // distance from a change point that is kept, as a fraction of the longest link

/** A row [name, margin] for each coordinate of a point that has to lie in a box. */
const inside = (name, point, box, scale) =>
  point && box ? [0, 1].flatMap((i) => between(`${name} ${i}`, point[i], box[i], box[i + 2], scale)) : [];
const around = (point) => point && [...point, ...point];
/** Rows of a value between two others; where those are the same it is exactly that. */
function between(name, value, low, high, scale) {
  const exact = low === high ? INSIDE : 0;
  return [
    [`${name} low`, (value - low) / scale + exact],
    [`${name} high`, (high - value) / scale + exact],
  ];
}

/** Rows [name, margin] of the lengths of a four-bar, and of the three excesses whose signs make its family. */
function ofLinks([first, second], { min, max, kept, ratio, extra }, scale) {
  const links = [
      first.radius,
      size(less(second.body_point, first.body_point)),
      second.radius,
      size(less(second.pivot, first.pivot)),
    ],
    longest = Math.max(...links),
    [crank, coupler, rocker, ground] = links;
  const excesses = [
    coupler + ground - crank - rocker,
    rocker + ground - crank - coupler,
    coupler + rocker - crank - ground,
  ];
  const rows = excesses.map((excess, k) => [`family ${k}`, excess / longest]);
  links.forEach((length, k) => {
    const given = extra.links?.[LINKS[k]];
    if (min) rows.push([`link_min ${k}`, (length - min) / scale]);
    if (max) rows.push([`link_max ${k}`, (max - length) / scale]);
    if (given) rows.push(...between(`links ${k}`, length, given, given, scale));
    if (kept.ratio) rows.push([`link_ratio_max ${k}`, (length - longest / (ratio ?? PRESET.ratio)) / scale]);
  });
  return rows;
}

/**
 * Rows [name, margin] of a linkage of `Misfit.made` for the limits of a motion; its transmission angle is looked at
 * where the drive is at `spots`.
 */
function rowsOf({ guides, linkage, at }, { limits }, scale, spots) {
  const { kept, extra, box } = limits,
    transmission = (q, least) => (at(q)?.transmission ?? 0) - least * RAD;
  const rows = guides.flatMap(({ pivot, pin }, k) =>
    ["pivot_box", `pivot_${"ab"[k]}_box`, `pivot_${"ab"[k]}`]
      .map((name, n) => [name, n ? (n === 1 ? extra[name] : around(extra[name])) : box])
      .flatMap(([name, bounds]) => inside(`${name} ${k}`, pivot ?? pin, bounds, scale)),
  );
  spots.forEach((q, k) =>
    rows.push([`transmission_angle_min ${k}`, transmission(q, kept.use ? (limits.transmission ?? PRESET.use) : 0)]),
  );
  if (guides.some(({ guide }) => guide !== "circle")) return rows;
  rows.push(...ofLinks(guides, limits, scale));
  if (kept.turn && linkage.turnsFully) {
    const ground = direction(less(guides[1].pivot, guides[0].pivot));
    for (const q of [ground, ground + Math.PI])
      rows.push([`transmission_angle_min_turn ${q === ground}`, transmission(q, limits.turn ?? PRESET.turn)]);
  }
  return rows;
}

export class Bounds {
  /** The limits of `motion` that a linkage satisfied for the motion `before`; a four-bar's `family` is one of them. */
  constructor(motion, scale, { made, before, spots, family }) {
    const held = rowsOf(made, before, scale, spots),
      signs = SIGNS[family],
      broken = new Set(
        held.filter(([name, margin]) => margin < -SLACK && !name.startsWith("family")).map(([name]) => name),
      );
    Object.assign(this, {
      motion,
      scale,
      broken,
      excesses: new Map(
        held
          .filter(([name]) => name.startsWith("family"))
          .map(([name, margin], k) => [name, { sign: signs ? Number(`${signs[k]}1`) : Math.sign(margin), margin }]),
      ),
    });
  }

  margins(made, spots) {
    return rowsOf(made, this.motion, this.scale, spots)
      .filter(([name]) => !this.broken.has(name))
      .map(([name, margin]) => {
        const excess = this.excesses.get(name);
        return excess ? excess.sign * margin - Math.min(CHANGE, Math.abs(excess.margin) / 2) : margin;
      });
  }
}

/**
 * The page's own verdict on a linkage that was moved on its branch, with the limits that it violates; null for a motion
 * with limits that the page does not compute.
 */
export function verdictOf(solution, motion, { places, turns, linkage }) {
  if (Object.keys(motion.limits.extra).some((name) => !COMPUTED.includes(name))) return null;
  const misfit = new Misfit(motion, solution),
    numbers = misfit.numbersOf(solution),
    made = misfit.made(numbers),
    drive = misfit.free ? misfit.driveOf(solution) : misfit.driveAt(numbers);
  const low = Math.min(...drive),
    high = Math.max(...drive),
    grid = Array.from({ length: GRID + 1 }, (_, k) => low + ((high - low) * k) / GRID),
    bodies = grid.map(made.at);
  const circuit = bodies.every(Boolean),
    worst = grid.reduce(
      (least, q, k) => (bodies[k] && bodies[k].transmission < (made.at(least)?.transmission ?? 0) ? q : least),
      low,
    );
  const sense = drive.at(-1) < drive[0] ? -1 : 1,
    order = motion.anyOrder || drive.every((q, k) => k === 0 || sense * (q - drive[k - 1]) > 0);
  const broken = rowsOf(made, motion, misfit.scale, [worst])
    .filter(([name, margin]) => !name.startsWith("family") && margin < -SLACK)
    .map(([name]) => name.split(" ")[0]);
  if (motion.spanMax && misfit.turns && high - low > motion.spanMax * RAD + SLACK) broken.push("crank_span_max");
  if (familyOf(motion) === "full_crank" && !linkage.turnsFully) broken.push("family");
  if (motion.limits.kept.reach && solution.size > PRESET.reach) broken.push("pivot_reach");
  const allowed = (pose, own, whole) => pose[own] ?? whole ?? Infinity,
    { rotation, position } = motion.tolerance;
  const limited = motion.poses.some((pose) =>
    Number.isFinite(Math.min(allowed(pose, "er", rotation), allowed(pose, "ep", position))),
  );
  const keeps = motion.poses.every(
    (pose, k) =>
      Math.abs(turns[k] ?? 0) <= allowed(pose, "er", rotation) && (places[k] ?? 0) <= allowed(pose, "ep", position),
  );
  return {
    order,
    branch: true,
    circuit,
    within_tolerance: limited ? keeps : null,
    practical_without_collisions: circuit && !broken.length,
    practical: circuit && !broken.length,
    reasons: [...new Set(broken)].map((name) => `${limitName(name)} is not kept`),
  };
}
