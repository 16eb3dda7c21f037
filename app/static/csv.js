// A motion as CSV, and the motion of a table that the service has read.

import { UNITS, clone, fixTravels, takeTiming, placeOf, wantsAngles, wantsPlaces } from "./motion.js";
import { fromRequest } from "./formats.js";

const SHARES = { weight_rotation: "wr", weight_position: "wp", tolerance_rotation: "er", tolerance_position: "ep" };

/** `motion` with the samples of a table that was read for "synthesize". */
export function withSamples(motion, { request, length_unit: unit }) {
  const found = fromRequest(request),
    next = { ...clone(motion), poses: found.poses, wanted: found.wanted };
  if (UNITS.includes(unit)) next.unit = unit;
  if (found.timing === "free") {
    takeTiming(next, wantsPlaces(next) ? "free" : "even");
    fixTravels(next);
    return next;
  }
  Object.assign(next, { direction: found.direction, span: found.span });
  const step = next.span / (next.poses.length - 1);
  takeTiming(next, next.poses.every((pose, k) => Math.abs(pose.t - k * step) <= 1e-9 * next.span) ? "even" : "table");
  return next;
}

/** The poses as CSV, with crank angles only if they are given. */
export function toCsv(motion) {
  const { poses, direction } = motion,
    columns = [];
  if (motion.timing !== "free") {
    const timed = clone(motion);
    fixTravels(timed);
    columns.push(["crank", (_, k) => direction * timed.poses[k].t]);
  }
  if (wantsPlaces(motion))
    columns.push(
      [`x [${motion.unit}]`, (pose) => placeOf(pose)?.[0]],
      [`y [${motion.unit}]`, (pose) => placeOf(pose)?.[1]],
    );
  if (wantsAngles(motion)) columns.push(["angle", (pose) => pose.angle]);
  for (const [name, key] of Object.entries(SHARES))
    if (poses.some((pose) => pose[key] !== undefined)) columns.push([name, (pose) => pose[key]]);
  const lines = poses.map((pose, k) => columns.map(([, value]) => value(pose, k) ?? "").join(","));
  return [columns.map(([name]) => name).join(","), ...lines, ""].join("\n");
}
