// Where a solution passes the samples: its crank angles at them, those of the request or its own, and the interval it uses.

import { drivePlaces, driveTurns } from "./drive.js";
import { travels } from "./motion.js";

const TURN = 360;

/** The shortest arc, [first, last] in degrees, that holds all angles and the angle 0. */
function shortestArc(angles) {
  const within = angles.map((angle) => ((angle % TURN) + TURN) % TURN).sort((a, b) => a - b);
  let [gap, begin] = [-1, 0];
  within.forEach((angle, k) => {
    const next = k + 1 < within.length ? within[k + 1] : within[0] + TURN;
    if (next - angle > gap) [gap, begin] = [next - angle, next % TURN];
  });
  return begin > 0 ? [begin - TURN, begin - gap] : [0, TURN - gap];
}

/**
 * For a solution, in degrees of crank from the first sample, or lengths where the drive does not turn (`turns`): `angles` at the samples; `sense`, 1 or -1, of
 * the crank; the interval used, `low` to `high` in that sense; `order`, the samples as they are passed.
 */
export function passing(solution, motion, turnsFully) {
  const own = motion.timing === "free" ? drivePlaces(solution) : null,
    turns = driveTurns(solution);
  const order = Array.from({ length: (own ?? motion.poses).length }, (_, k) => k);
  if (own && motion.anyOrder) {
    const [first, last] = !turns
      ? [Math.min(...own), Math.max(...own)]
      : motion.closed && turnsFully
        ? [0, TURN]
        : shortestArc(own);
    const angles = own.map((angle) => (turns && angle > last + 1e-9 ? angle - TURN : angle));
    order.sort((a, b) => angles[a] - angles[b]);
    return { angles, sense: 1, low: first, high: last, order, turns };
  }
  const given = own ?? travels(motion).map((travel) => motion.direction * travel);
  const sense = given.at(-1) < 0 ? -1 : 1,
    last = Math.abs(given.at(-1) ?? 0);
  return { angles: given, sense, low: 0, high: own && motion.closed && turnsFully ? TURN : last, order, turns };
}

/** Travels from `low` to `high` at which the samples are passed, in the crank's sense; those outside come in by whole turns. */
export function marksWithin({ angles, sense, turns }, low, high) {
  return angles.map((angle) => {
    const travel = sense * angle;
    const spare = turns ? 1e-9 : 1e-9 * (high - low);
    if (travel < low - spare) return turns && travel + TURN <= high + spare ? travel + TURN : null;
    return travel <= high + spare ? travel : null;
  });
}

/** The error of an angle in degrees, got minus wanted; with free crank angles whole turns do not count. */
export function angleError(motion, wanted, got) {
  const gap = got - wanted;
  return motion.timing === "free" ? gap - TURN * Math.round(gap / TURN) : gap;
}
