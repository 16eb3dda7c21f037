// Samples as a table: CSV of a motion, and tables that the service has read.

import { UNITS, clone, fixTravels, takeTiming, placeOf, wantsAngles, wantsPlaces } from "./motion.js";
import { fromRequest } from "./formats.js";
import { ask } from "./service.js";
import { capital } from "./shell.js";

const SHARES = { weight_rotation: "wr", weight_position: "wp", tolerance_rotation: "er", tolerance_position: "ep" };

/** The bytes of a file in base64. */
function base64Of(file) {
  return new Promise((resolve, reject) => {
    const reader = new FileReader();
    reader.addEventListener("load", () => resolve(reader.result.slice(reader.result.indexOf(",") + 1)));
    reader.addEventListener("error", () => reject(new Error("The file cannot be read.")));
    reader.readAsDataURL(file);
  });
}

/**
 * Reads a table, text or a file, for a question of the service: {request, length_unit, columns, heads, notes}. `columns` chooses columns.
 * Throws Error with a sentence; if columns have to be chosen it has the `heads` of the table.
 */
export async function readTable(source, question, columns = null) {
  const table = typeof source === "string" ? { table: source } : { file: await base64Of(source) };
  const reply = await (await ask("/v1/motion", { ...table, question, ...(columns ? { columns } : {}) })).json();
  if (reply.status === "read") return reply;
  const { message, heads } = reply, detail = message.replace(/; or choose columns, as in .*$/, question === "synthesize" ? "; or choose the columns below" : "");
  throw Object.assign(new Error(`${capital(detail)}.`), { heads: heads.length ? heads : null });
}

/** `motion` with the samples of a table that was read for "synthesize". */
export function withSamples(motion, { request, length_unit: unit }) {
  const found = fromRequest(request), next = { ...clone(motion), poses: found.poses, wanted: found.wanted };
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
  const { poses, direction } = motion, columns = [];
  if (motion.timing !== "free") {
    const timed = clone(motion);
    fixTravels(timed);
    columns.push(["crank", (_, k) => direction * timed.poses[k].t]);
  }
  if (wantsPlaces(motion)) columns.push([`x [${motion.unit}]`, (pose) => placeOf(pose)?.[0]], [`y [${motion.unit}]`, (pose) => placeOf(pose)?.[1]]);
  if (wantsAngles(motion)) columns.push(["angle", (pose) => pose.angle]);
  for (const [name, key] of Object.entries(SHARES)) if (poses.some((pose) => pose[key] !== undefined)) columns.push([name, (pose) => pose[key]]);
  const lines = poses.map((pose, k) => columns.map(([, value]) => value(pose, k) ?? "").join(","));
  return [columns.map(([name]) => name).join(","), ...lines, ""].join("\n");
}
