// Fit of a linkage to a motion: its joints and errors at each pose, and the pose of the largest error.

import { text } from "./drawing.js";
import { Linkage } from "./kinematics.js";
import { itemOf, placeOf, wantsAngles, wantsPlaces } from "./motion.js";
import { RAD, less, size } from "./plane.js";
import { listed } from "./shell.js";
import { angleError, passing } from "./timing.js";

/** The links of a four-bar. */
export const LINKS = ["crank", "coupler", "rocker", "ground"];

/** The index of the largest number of a list with nulls; null if all are. */
function worstOf(list) {
  const sizes = list.map((value) => (value === null ? -1 : Math.abs(value))),
    maximum = Math.max(-1, ...sizes);
  return maximum < 0 ? null : sizes.indexOf(maximum);
}

/**
 * A solution's linkage and, for each pose of the motion, joints `at`, `places` (distance from the wanted place) and
 * `turns` (degrees actual minus required), null where nothing is wanted or the loop is open; `worst` has the largest of
 * each.
 */
export function fitOf(solution, motion) {
  const linkage = new Linkage(solution),
    pass = passing(solution, motion, linkage.turnsFully),
    at = pass.angles.map((angle) => linkage.at(angle * RAD)),
    placed = wantsPlaces(motion) && linkage.mount;
  const places = motion.poses.map((pose, k) => {
    const target = placed && at[k]?.p && placeOf(pose);
    return target ? size(less(at[k].p, target)) : null;
  });
  const turns = motion.poses.map(({ angle }, k) =>
    wantsAngles(motion) && angle !== null && at[k] ? angleError(motion, angle, at[k].rotation / RAD) : null,
  );
  return { linkage, pass, at, places, turns, worst: { place: worstOf(places), turn: worstOf(turns) } };
}

/** A place or length, zero where only rounding keeps it from that, for a motion of this size. */
export const settled = (value, scale) => (Math.abs(value) < 1e-10 * scale ? 0 : value);

/** An error with its unit; "rounding" where it is nothing beside the motion's size. */
export function errorText(value, scale, unit) {
  if (value === null || value === undefined) return null;
  return settled(value, scale) === 0 ? "rounding" : `${text(value, 3)}${unit}`;
}

export const roundedLinks = ({ links, lengths }) => Object.entries(links ?? lengths ?? {});

/** The largest errors of rounded links, or why there are none; null where nothing is rounded. */
export function roundedText({ rounded }, scale, unit) {
  if (!rounded?.closes) return rounded?.reason;
  if (!roundedLinks(rounded).length) return null;
  const { position_max, rotation_max } = rounded.errors,
    errors = [errorText(position_max, scale, unit), errorText(rotation_max, 57, "°")];
  return listed(...errors.filter((error) => error !== "rounding")) || "exact";
}

/** Rows [name, error with its unit, number of the pose] of the largest errors; the pose is null for mere rounding. */
export function worstRows({ places, turns, worst }, { unit }, scale) {
  const rows = [];
  if (worst.place !== null) rows.push(["position", errorText(places[worst.place], scale, ` ${unit}`), worst.place + 1]);
  if (worst.turn !== null) rows.push(["angle", errorText(Math.abs(turns[worst.turn]), 57, "°"), worst.turn + 1]);
  return rows.map(([name, error, pose]) => [name, error, error === "rounding" ? null : pose]);
}

/** These rows in a few words: "0.27 mm (pose 5) and 0.08° (pose 4)". */
export const worstWords = (rows, motion) =>
  [...new Set(rows.map(([, error, k]) => (k === null ? error : `${error} (${itemOf(motion)} ${k})`)))].join(" and ");

/** Return true if two solutions are the same linkage to within a thousandth of its size. */
export function alike(solution, reference) {
  const numbersOf = ({ links, mount, guides }) =>
    links
      ? [...LINKS.map((name) => links[name]), ...(mount ? [...mount.pivot_a, ...mount.pivot_b] : [])]
      : guides.flatMap(({ pivot, pin, radius, direction, body_direction, body_point }) => [
          ...(pivot ?? pin ?? []),
          ...body_point,
          radius ?? direction ?? body_direction ?? 0,
        ]);
  const sort = ({ links, kind, driver, branch }) => JSON.stringify(links ? [branch] : [kind, driver, branch]);
  if (sort(solution) !== sort(reference)) return false;
  const [a, b] = [solution, reference].map(numbersOf),
    sizes = solution.links ? a.slice(0, LINKS.length) : a,
    longest = Math.max(1e-300, ...sizes.map(Math.abs));
  return a.length === b.length && a.every((value, k) => Math.abs(value - b[k]) <= 1e-3 * longest);
}

/** Rows of the guides of a solution with rails or slots; body points are in the body's frame. */
export function guideRows({ guides, driver }, number, position, length) {
  const pair = (point) => point.map(position).join(", ");
  const rowsOf = ({ guide, pivot, radius, point, direction, pin, body_direction, body_point, used }, k) => [
    [`${k ? "Second" : "First"} guide`, guide],
    pivot && ["– pivot", pair(pivot)],
    pivot && ["– radius", length(radius)],
    point && ["– through", pair(point)],
    point && ["– direction", `${number(direction)}°`],
    pin && ["– pin", pair(pin)],
    pin && ["– direction in the body", `${number(body_direction)}°`],
    ["– body point", pair(body_point)],
    used && ["– used", `${position(used[0])} to ${length(used[1])}`],
  ];
  return [["Driven by", driver], ...guides.flatMap(rowsOf).filter(Boolean)];
}
