// What a designer asks of a solution next, as curves, a band, and rows of numbers.

import { text } from "./drawing.js";
import { lawCurves } from "./law.js";
import { RAD } from "./plane.js";

const size = (vector) => vector && Math.hypot(...vector);

/** Curves of an analysis over travels in the crank's sense: [{title, x, values, degreesY}]; none without an analysis. */
export function analysisCurves({ analysis, ...solution }, sense, unit) {
  if (solution.output) return lawCurves(solution, sense, unit);
  if (!analysis) return [];
  const { curve } = analysis;
  const rows = (curve.crank_angle ?? curve.travel).map((angle, k) => [sense * angle, k]).sort((a, b) => a[0] - b[0]);
  const x = rows.map(([travel]) => travel),
    at = (list) => rows.map(([, k]) => list[k]);
  const found = [];
  if (curve.velocity) {
    found.push({ title: `Velocity of the body point, ${unit}/s`, x, values: at(curve.velocity).map(size) });
    found.push({ title: `Acceleration of the body point, ${unit}/s²`, x, values: at(curve.acceleration).map(size) });
  }
  found.push({
    title: "Angular velocity of the coupler, degrees a second",
    x,
    values: at(curve.angular_velocity.coupler),
  });
  if (curve.drive_load)
    found.push({
      title: curve.crank_angle ? `Torque of the drive, force × ${unit}` : "Force of the drive",
      x,
      values: at(curve.drive_load),
    });
  return found.filter(({ values }) => values.some((value) => value !== null));
}

/** The band that 95 % of the linkages made keep to, [[place, radius] | null] along the path; null without a study of positions. */
export function band({ tolerance_study: study }, linkage) {
  const radii = study?.band.position?.p95;
  if (!radii) return null;
  return study.band.crank_angle.map((angle, k) => {
    const place = linkage.at(angle * RAD)?.p;
    return place && radii[k] !== null ? [place, radii[k]] : null;
  });
}

/** Rows [name, value] for the numbers of a solution. */
export function studyRows({ tolerance_study: study, rounded }, lengthUnit) {
  const rows = [];
  if (rounded?.closes && (rounded.combinations ?? null) !== null) {
    const of = `of ${rounded.combinations} combinations`;
    rows.push([
      "Choice of lengths",
      rounded.exhaustive ? `the best ${of}` : `the best of ${rounded.combinations_examined} tried, ${of}`,
    ]);
  }
  if (!study) return rows;
  const { position, rotation, largest } = study,
    off = (value, unit = "") => (value === null ? "does not close" : `${text(value, 3)}${unit}`);
  if (position) rows.push(["As made, off by (95 %)", off(position.worst.p95, ` ${lengthUnit}`)]);
  rows.push(["As made, turned by (95 %)", off(rotation.worst.p95, "°")]);
  if (largest.position ?? largest.rotation) rows.push(["Contributes most", largest.position ?? largest.rotation]);
  return rows;
}
