// Studies of a solution, shown as curves, a band, and rows of numbers.

import { text } from "./drawing.js";
import { lawCurves } from "./law.js";
import { RAD } from "./plane.js";

const size = (vector) => vector && Math.hypot(...vector);

/** Curves of an analysis over travels in the crank's sense: [{title, x, values}]; none without an analysis. */
export function analysisCurves({ analysis, ...solution }, sense, unit) {
  if (solution.output) return lawCurves(solution, sense, unit);
  if (!analysis) return [];
  const { velocity, acceleration, angular_velocity, drive_load: load, crank_angle, travel } = analysis.curve,
    positions = crank_angle ?? travel,
    order = [...positions.keys()].sort((i, j) => sense * (positions[i] - positions[j])),
    x = order.map((k) => sense * positions[k]),
    at = (list) => order.map((k) => list[k]);
  const drive = crank_angle ? `Torque of the drive, N·${unit}` : "Force of the drive, N";
  const curves = [
    velocity && [`Velocity of the body point, ${unit}/s`, at(velocity).map(size)],
    velocity && [`Acceleration of the body point, ${unit}/s²`, at(acceleration).map(size)],
    ["Angular velocity of the coupler, degrees a second", at(angular_velocity.coupler)],
    load && [drive, at(load)],
  ];
  const shown = curves.filter((curve) => curve && curve[1].some((value) => value !== null));
  return shown.map(([title, values]) => ({ title, x, values }));
}

/** The band that 95 % of the linkages made keep to, [[place, radius] | null] along the path; null without a study. */
export function band({ tolerance_study: study }, linkage) {
  const radii = study?.band.position?.p95;
  if (!radii) return null;
  return study.band.crank_angle.map((angle, k) => {
    const position = linkage.at(angle * RAD)?.p;
    return position && radii[k] !== null ? [position, radii[k]] : null;
  });
}

/** Rows [name, value] for the numbers of a solution. */
export function studyRows({ tolerance_study: study, rounded }, lengthUnit) {
  const { combinations = null, combinations_examined: tried, exhaustive } = rounded ?? {},
    of = `of ${combinations} combinations`,
    off = (value, unit = "") => (value === null ? "does not close" : `${text(value, 3)}${unit}`),
    { position, rotation, largest } = study ?? {},
    dominant = largest?.position ?? largest?.rotation;
  const rows = [
    rounded?.closes &&
      combinations !== null && [
        "Choice of lengths",
        exhaustive ? `the best ${of}` : `the best of ${tried} tried, ${of}`,
      ],
    position && ["As made, off by (95 %)", off(position.worst.p95, ` ${lengthUnit}`)],
    rotation && ["As made, turned by (95 %)", off(rotation.worst.p95, "°")],
    dominant && ["Contributes most", dominant],
  ];
  return rows.filter(Boolean);
}
