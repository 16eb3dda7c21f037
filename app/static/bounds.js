// The limits of a motion that a linkage satisfies, as margins that a refinement keeps from becoming negative.

import { LINKS } from "./fit.js";
import { SIGNS } from "./kinematics.js";
import { Misfit } from "./misfit.js";
import { PRESET, familyOf } from "./motion.js";
import { RAD, direction, less, size } from "./plane.js";
import { limitName } from "./verdict.js";

/** Margin by which a linkage satisfies a limit, as a fraction of the motion's size or in radians. */
export const INSIDE = 1e-5;
/** Limits without a field in the form that the page computes. */
const COMPUTED = ["links", "pivot_a", "pivot_b", "pivot_a_box", "pivot_b_box"];
const SLACK = 1e-6; // by which a limit may be missed, as a fraction of the motion's size or in radians
const GRID = 360; // steps of the used interval at which the transmission angle is looked at
const CHANGE = 1e-3; // distance from a change point that is kept, as a fraction of the longest link

/** Rows [name, margin] of a value between two others; where those are the same it is exactly that. */
function between(name, value, low, high, scale) {
  const exact = low === high ? INSIDE : 0;
  return [
    [`${name} low`, (value - low) / scale + exact],
    [`${name} high`, (high - value) / scale + exact],
  ];
}
/** Return the margins of each coordinate of a point that has to lie in a box. */
const inside = (name, point, box, scale) =>
  point && box ? [0, 1].flatMap((i) => between(`${name} ${i}`, point[i], box[i], box[i + 2], scale)) : [];
const around = (point) => point && [...point, ...point];

/** Rows of the lengths of a four-bar, and of the three excesses whose signs make its family. */
function ofLinks([first, second], { min, max, kept, ratio, extra }, scale) {
  const couplerLength = size(less(second.body_point, first.body_point)),
    links = [first.radius, couplerLength, second.radius, size(less(second.pivot, first.pivot))],
    longest = Math.max(...links),
    [crank, coupler, rocker, ground] = links,
    total = crank + coupler + rocker + ground;
  const rows = [rocker, coupler, ground].map((length, k) => [`family ${k}`, (total - 2 * (crank + length)) / longest]);
  for (const [k, length] of links.entries()) {
    const required = extra.links?.[LINKS[k]];
    if (min) rows.push([`link_min ${k}`, (length - min) / scale]);
    if (max) rows.push([`link_max ${k}`, (max - length) / scale]);
    if (required) rows.push(...between(`links ${k}`, length, required, required, scale));
    if (kept.ratio) rows.push([`link_ratio_max ${k}`, (length - longest / (ratio ?? PRESET.ratio)) / scale]);
  }
  return rows;
}

/**
 * Rows [name, margin] of a linkage of `Misfit.made` for the limits of a motion; its transmission angle is looked at
 * where the drive is at `spots`.
 */
function rowsOf({ guides, linkage, at }, { limits }, scale, spots) {
  const { kept, extra, box } = limits,
    transmission = (q, minimum) => (at(q)?.transmission ?? 0) - minimum * RAD,
    minAngle = kept.use ? (limits.transmission ?? PRESET.use) : 0;
  const rows = guides.flatMap(({ pivot, pin }, k) => {
    const own = `pivot_${"ab"[k]}`,
      boxes = { pivot_box: box, [`${own}_box`]: extra[`${own}_box`], [own]: around(extra[own]) };
    return Object.entries(boxes).flatMap(([name, bounds]) => inside(`${name} ${k}`, pivot ?? pin, bounds, scale));
  });
  rows.push(...spots.map((q, k) => [`transmission_angle_min ${k}`, transmission(q, minAngle)]));
  if (guides.some(({ guide }) => guide !== "circle")) return rows;
  rows.push(...ofLinks(guides, limits, scale));
  if (!kept.turn || !linkage.turnsFully) return rows;
  const ground = direction(less(guides[1].pivot, guides[0].pivot)),
    turn = (q, k) => [`transmission_angle_min_turn ${k}`, transmission(q, limits.turn ?? PRESET.turn)];
  return [...rows, ...[ground, ground + Math.PI].map(turn)];
}

export class Bounds {
  /** The limits of `motion` that a linkage satisfied for the motion `before`; a four-bar's `family` is one of them. */
  constructor(motion, scale, { made: model, before, spots, family }) {
    const margins = rowsOf(model, before, scale, spots),
      isFamily = ([name]) => name.startsWith("family"),
      broken = margins.filter((row) => row[1] < -SLACK && !isFamily(row)),
      signs = SIGNS[family],
      signOf = (margin, k) => (signs ? Number(`${signs[k]}1`) : Math.sign(margin)),
      excess = ([name, margin], k) => [name, { sign: signOf(margin, k), margin }];
    Object.assign(this, { motion, scale, broken: new Set(broken.map(([name]) => name)) });
    this.excesses = new Map(margins.filter(isFamily).map(excess));
  }

  margins(model, spots) {
    return rowsOf(model, this.motion, this.scale, spots)
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
    model = misfit.made(numbers),
    drive = misfit.free ? misfit.driveOf(solution) : misfit.driveAt(numbers),
    [low, high] = [Math.min(...drive), Math.max(...drive)],
    grid = Array.from({ length: GRID + 1 }, (_, k) => low + ((high - low) * k) / GRID),
    angles = grid.map((q) => model.at(q)?.transmission ?? Infinity);
  const circuit = angles.every(Number.isFinite),
    worst = grid[angles.indexOf(Math.min(...angles))],
    sense = drive.at(-1) < drive[0] ? -1 : 1,
    order = motion.anyOrder || drive.every((q, k) => k === 0 || sense * (q - drive[k - 1]) > 0);
  const isBroken = ([name, margin]) => !name.startsWith("family") && margin < -SLACK,
    rows = rowsOf(model, motion, misfit.scale, [worst]).filter(isBroken),
    broken = rows.map(([name]) => name.split(" ")[0]);
  if (motion.spanMax && misfit.turns && high - low > motion.spanMax * RAD + SLACK) broken.push("crank_span_max");
  if (familyOf(motion) === "full_crank" && !linkage.turnsFully) broken.push("family");
  if (motion.limits.kept.reach && solution.size > PRESET.reach) broken.push("pivot_reach");
  const { rotation, position } = motion.tolerance,
    allowed = motion.poses.map(({ er, ep }) => [er ?? rotation ?? Infinity, ep ?? position ?? Infinity]);
  const isWithinTolerance = allowed.every(
      ([turn, off], k) => Math.abs(turns[k] ?? 0) <= turn && (places[k] ?? 0) <= off,
    ),
    practical = circuit && !broken.length;
  return {
    order,
    branch: true,
    circuit,
    within_tolerance: allowed.flat().some(Number.isFinite) ? isWithinTolerance : null,
    practical_without_collisions: practical,
    practical,
    reasons: [...new Set(broken)].map((name) => `${limitName(name)} is violated`),
  };
}
