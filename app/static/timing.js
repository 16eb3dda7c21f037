// The drive of a solution: whether it turns, where it is at the samples, and the interval that it uses.

import { travels } from "./motion.js";

const TURN = 360;

/** Return true if the drive coordinate of a solution is an angle; for a slider or cylinder it is a length. */
export const driveTurns = (solution) => !["slider", "cylinder"].includes(solution.driver);

/** Return the drive positions at the samples, in degrees or lengths; null if the request gives them. */
export const drivePlaces = (solution) => solution.crank_angle ?? solution.travel ?? null;

/** The name of a solution's drive: crank, slider, cylinder or hinge. */
export const driveName = (solution) => solution.driver ?? "crank";

/** The shortest arc, [first, last] in degrees, that holds all angles and the angle 0. */
function shortestArc(angles) {
  const within = angles.map((angle) => ((angle % TURN) + TURN) % TURN).sort((a, b) => a - b);
  let [gap, begin] = [-1, 0];
  for (const [k, angle] of within.entries()) {
    const next = within[k + 1] ?? within[0] + TURN;
    if (next - angle > gap) [gap, begin] = [next - angle, next % TURN];
  }
  return begin > 0 ? [begin - TURN, begin - gap] : [0, TURN - gap];
}

/**
 * For a solution, in degrees of crank from the first sample, or lengths where the drive does not turn (`turns`):
 * `angles` at the samples; `sense`, 1 or -1, of the crank; the interval used, `low` to `high` in that sense; `order`,
 * the samples as they are passed.
 */
export function passing(solution, motion, turnsFully) {
  const own = motion.timing === "free" ? drivePlaces(solution) : null,
    turns = driveTurns(solution);
  const order = [...(own ?? motion.poses).keys()];
  if (own && motion.anyOrder) {
    const arc = motion.closed && turnsFully ? [0, TURN] : shortestArc(own),
      [low, high] = turns ? arc : [Math.min(...own), Math.max(...own)],
      angles = own.map((angle) => (turns && angle > high + 1e-9 ? angle - TURN : angle));
    order.sort((a, b) => angles[a] - angles[b]);
    return { angles, sense: 1, low, high, order, turns };
  }
  const angles = own ?? travels(motion).map((travel) => motion.direction * travel),
    last = angles.at(-1) ?? 0,
    high = own && motion.closed && turnsFully ? TURN : Math.abs(last);
  return { angles, sense: last < 0 ? -1 : 1, low: 0, high, order, turns };
}

/** Travels from `low` to `high` at which samples are passed, in the crank's sense; others come in by whole turns. */
export function marksWithin({ angles, sense, turns }, low, high) {
  return angles.map((angle) => {
    const travel = sense * angle;
    const spare = turns ? 1e-9 : 1e-9 * (high - low);
    if (travel < low - spare) return turns && travel + TURN <= high + spare ? travel + TURN : null;
    return travel <= high + spare ? travel : null;
  });
}

/** The error of an angle in degrees, actual minus required; with free crank angles whole turns do not count. */
export function angleError(motion, target, got) {
  const gap = got - target;
  return motion.timing === "free" ? gap - TURN * Math.round(gap / TURN) : gap;
}
