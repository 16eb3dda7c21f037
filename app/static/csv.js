// The motion as rows of CSV, and rows of CSV or from a spreadsheet as a motion.

import { UNITS, clone, emptyMotion, fixTravels, takeTiming, placeOf, wantsAngles, wantsPlaces } from "./motion.js";
import { readNumber, readTable } from "./rows.js";

const COLUMNS = {
  crank: "t", crank_angle: "t", theta1: "t", x: "x", y: "y", angle: "angle", rotation: "angle", gamma: "angle", theta: "angle", phi: "angle",
  weight: "w", weight_rotation: "wr", weight_position: "wp", tolerance_rotation: "er", tolerance_position: "ep",
};
const POSES = {
  columns: COLUMNS, otherwise: "free, or even over a crank span", named: "crank, x, y, angle", known: "x, y, angle and crank are", wanted: "crank, x, y, angle; or x, y, angle; or x, y",
  byNumber: { 4: ["t", "x", "y", "angle"], 3: ["x", "y", "angle"], 2: ["x", "y"] },
};
const ANGLES = ["t", "angle", "er"];

/** The length unit that the columns x and y name; null where they name none. */
function lengthUnit(names, units) {
  const found = new Set(units.filter((unit, k) => ["x", "y"].includes(names[k]) && unit));
  for (const unit of found) if (!UNITS.includes(unit)) throw new Error(`The unit ${unit} of a length is not known; mm, cm, m and in are.`);
  if (found.size > 1) throw new Error("The columns x and y name different units.");
  return [...found][0] ?? null;
}

/**
 * `motion` with the poses of CSV rows. The columns are named in the first line or recognised by their number; without a column
 * of crank angles these are free; an empty cell is a place or angle that is missing; angles in "rad" are converted. Throws Error
 * with the number of the line.
 */
export function fromCsv(text, motion = emptyMotion()) {
  const { names, units, rows, at } = readTable(text, POSES);
  if (rows.length > 1024) throw new Error(`There are ${rows.length} rows; at most 1024 are allowed.`);
  const has = (name) => names.includes(name);
  const place = has("x") && has("y");
  if (!place && !has("angle")) throw new Error("The rows need x and y, or an angle, or both.");
  const used = [...names.entries()].filter(([, name]) => name), unit = lengthUnit(names, units);
  const scale = names.map((name, k) => (ANGLES.includes(name) && units[k] === "rad" ? 180 / Math.PI : 1));
  const poses = rows.map((row, k) => {
    const pose = { t: 0, x: 0, y: 0, angle: 0 };
    for (const [column, name] of used) {
      const cell = row[column] ?? "", value = Number((readNumber(cell, at[k], column, name !== "t") * scale[column]).toPrecision(15));
      if (["x", "y", "angle"].includes(name)) pose[name] = cell ? value : null;
      else if (name === "t") pose.t = value;
      else if (cell) for (const one of name === "w" ? ["wr", "wp"] : [name]) pose[one] = value;
    }
    if (!has("t") && !(place && placeOf(pose)) && !(has("angle") && pose.angle !== null)) throw new Error(`Line ${at[k]} has neither a place nor an angle.`);
    return pose;
  });
  const next = { ...clone(motion), poses };
  if (unit) next.unit = unit;
  next.wanted = place && has("angle") ? "both" : place ? "position" : "rotation";
  if (has("t")) {
    const first = poses[0].t, whole = poses.at(-1).t - first;
    next.direction = whole < 0 ? -1 : 1;
    next.span = Math.abs(whole);
    poses.forEach((pose) => { pose.t = (pose.t - first) * next.direction; });
    const step = next.span / (poses.length - 1);
    takeTiming(next, poses.every((pose, k) => Math.abs(pose.t - k * step) <= 1e-9 * next.span) ? "even" : "table");
  } else {
    takeTiming(next, place ? "free" : "even");
    fixTravels(next);
  }
  return next;
}

/** The poses as CSV that `fromCsv` reads; crank angles only where they are given. */
export function toCsv(motion) {
  const { poses, direction } = motion, own = (name) => poses.some((pose) => pose[name] !== undefined);
  const columns = [];
  if (motion.timing !== "free") {
    const timed = clone(motion);
    fixTravels(timed);
    columns.push(["crank", (_, k) => direction * timed.poses[k].t]);
  }
  if (wantsPlaces(motion)) columns.push(["x", (pose) => placeOf(pose)?.[0]], ["y", (pose) => placeOf(pose)?.[1]]);
  if (wantsAngles(motion)) columns.push(["angle", (pose) => pose.angle]);
  for (const [name, key] of Object.entries(COLUMNS)) if (key !== "w" && name.includes("_") && key.length === 2 && own(key)) columns.push([name, (pose) => pose[key]]);
  const lines = poses.map((pose, k) => columns.map(([, value]) => value(pose, k) ?? "").join(","));
  return [columns.map(([name]) => name).join(","), ...lines, ""].join("\n");
}
