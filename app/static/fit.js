// How well a linkage meets a motion: its joints and errors at each pose, the worst pose by its number, the limits that hold it.

import { text } from "./drawing.js";
import { Linkage } from "./kinematics.js";
import { itemOf, placeOf, wantsAngles, wantsPlaces } from "./motion.js";
import { RAD } from "./plane.js";
import { angleError, passing } from "./timing.js";

/** The index of the largest number of a list with nulls; null if all are. */
function worstOf(list) {
  return list.reduce(
    (best, value, k) => (value !== null && (best === null || Math.abs(value) > Math.abs(list[best])) ? k : best),
    null,
  );
}

/**
 * A solution's linkage and, for each pose of the motion, joints `at`, `places` (distance from the wanted place) and `turns`
 * (degrees got minus wanted), null where nothing is wanted or the loop is open; `worst` has the pose of the largest of each.
 */
export function fitOf(solution, motion) {
  const linkage = new Linkage(solution),
    pass = passing(solution, motion, linkage.turnsFully);
  const at = pass.angles.map((angle) => linkage.at(angle * RAD));
  const places = motion.poses.map((pose, k) => {
    const place = wantsPlaces(motion) && linkage.mount ? placeOf(pose) : null;
    return place && at[k]?.p ? Math.hypot(at[k].p[0] - place[0], at[k].p[1] - place[1]) : null;
  });
  const turns = motion.poses.map((pose, k) =>
    wantsAngles(motion) && pose.angle !== null && at[k] ? angleError(motion, pose.angle, at[k].rotation / RAD) : null,
  );
  return { linkage, pass, at, places, turns, worst: { place: worstOf(places), turn: worstOf(turns) } };
}

/** A place or length, zero where only rounding keeps it from that, for a motion of this size. */
export const settled = (value, size) => (Math.abs(value) < 1e-10 * size ? 0 : value);

/** An error with its unit; "rounding" where it is nothing beside the motion's size. */
export function errorText(value, size, unit) {
  if (value === null || value === undefined) return null;
  return settled(value, size) === 0 ? "rounding" : `${text(value, 3)}${unit}`;
}

export const roundedLinks = ({ links, lengths }) => Object.entries(links ?? lengths ?? {});

/** The largest errors of rounded links, or why there are none; null where nothing is rounded. */
export function roundedText({ rounded }, size, unit) {
  if (!rounded?.closes) return rounded?.reason;
  const { position_max, rotation_max } = rounded.errors;
  return roundedLinks(rounded).length
    ? [errorText(position_max, size, unit), errorText(rotation_max, 57, "°")]
        .filter(Boolean)
        .join(", ")
        .replace(/^rounding(, rounding)?$/, "exact")
        .replace(/rounding, |, rounding/, "")
    : null;
}

/** Rows [name, error with its unit, number of the pose] of the largest errors; the pose is null where nothing is worth naming. */
export function worstRows({ places, turns, worst }, { unit }, size) {
  const rows = [];
  if (worst.place !== null) rows.push(["position", errorText(places[worst.place], size, ` ${unit}`), worst.place + 1]);
  if (worst.turn !== null) rows.push(["angle", errorText(Math.abs(turns[worst.turn]), 57, "°"), worst.turn + 1]);
  return rows.map(([name, error, pose]) => [name, error, error === "rounding" ? null : pose]);
}

/** These rows in a few words: "0.27 mm (pose 5) and 0.08° (pose 4)". */
export const worstWords = (rows, motion) =>
  rows.map(([, error, k]) => (k === null ? error : `${error} (${itemOf(motion)} ${k})`)).join(" and ");

/** Whether two solutions are the same linkage to within a thousandth of its size. */
export function alike(one, other) {
  if (!one.links || !other.links) return !one.links && !other.links && alikeGuides(one, other);
  const sizes = ["crank", "coupler", "rocker", "ground"],
    longest = Math.max(...sizes.map((name) => one.links[name]));
  if (
    one.branch !== other.branch ||
    sizes.some((name) => Math.abs(one.links[name] - other.links[name]) > 1e-3 * longest)
  )
    return false;
  const places = (solution) => (solution.mount ? [...solution.mount.pivot_a, ...solution.mount.pivot_b] : []);
  const [a, b] = [places(one), places(other)];
  return a.every((value, k) => Math.abs(value - b[k]) <= 1e-3 * longest);
}

/** The same of two linkages with rails or slots: guides of the same sorts, at the same places. */
function alikeGuides(one, other) {
  if (one.kind !== other.kind || one.driver !== other.driver || one.branch !== other.branch) return false;
  const numbers = ({ guides }) =>
    guides.flatMap(({ pivot, pin, radius, direction, body_direction, body_point }) => [
      ...(pivot ?? pin ?? []),
      ...body_point,
      radius ?? 0,
      direction ?? body_direction ?? 0,
    ]);
  const [a, b] = [numbers(one), numbers(other)],
    longest = Math.max(1e-300, ...a.map(Math.abs));
  return a.length === b.length && a.every((value, k) => Math.abs(value - b[k]) <= 1e-3 * longest);
}

/** Rows of the guides of a solution with rails or slots; body points are in the body's frame. */
export function guideRows({ guides, driver }, number, place, length) {
  const pair = (point) => point.map((value) => place(value)).join(", ");
  return [
    ["Driven by", driver],
    ...guides.flatMap((one, k) => {
      const name = `${k ? "Second" : "First"} guide`,
        rows = [[name, one.guide]];
      if (one.guide === "circle") rows.push(["– pivot", pair(one.pivot)], ["– radius", length(one.radius)]);
      else if (one.guide === "rail")
        rows.push(["– through", pair(one.point)], ["– direction", `${number(one.direction)}°`]);
      else rows.push(["– pin", pair(one.pin)], ["– direction in the body", `${number(one.body_direction)}°`]);
      rows.push(["– body point", pair(one.body_point)]);
      if (one.used) rows.push(["– used", `${place(one.used[0])} to ${length(one.used[1])}`]);
      return rows;
    }),
  ];
}
