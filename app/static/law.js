// A function of a crank or slider as plain values: its drives, its request, its faults, and its answer as it is shown.

import { numberOf } from "./decimal.js";
import { text } from "./drawing.js";
import { errorText } from "./fit.js";
import { practical } from "./motion.js";
import { Pairs } from "./pairs.js";
import { $ } from "./shell.js";

const TRAVEL = "length";
const kindsOf = (kind, input_unit, output_unit) => ({
  ...(input_unit && { input_unit }),
  ...(output_unit && { output_unit }),
  mechanisms: [kind],
});
/** Fields of the request for each drive (`asks`), and the names of its input and output (`says`). */
export const DRIVES = {
  four_bar: { asks: {}, says: ["Crank turns", "Rocker turns"] },
  crank_slider: { asks: kindsOf("slider_crank", null, TRAVEL), says: ["Crank turns", "Slider moves"] },
  crank_cylinder: { asks: kindsOf("swinging_block", null, TRAVEL), says: ["Crank turns", "Cylinder extends"] },
  slider_crank: { asks: kindsOf("slider_crank", TRAVEL), says: ["Slider moves", "Crank turns"] },
  cylinder_crank: { asks: kindsOf("swinging_block", TRAVEL), says: ["Cylinder extends", "Crank turns"] },
  slider_lever: { asks: kindsOf("rail_slot", TRAVEL), says: ["Slider moves", "Lever turns"] },
  slider_slider: { asks: kindsOf("two_rails", TRAVEL, TRAVEL), says: ["Slider moves", "Other slider moves"] },
  slider_cylinder: {
    asks: kindsOf("rail_slot", TRAVEL, TRAVEL),
    says: ["Slider, or cylinder, moves", "The other moves"],
  },
};
/** Functions that are asked for by a few numbers. */
export const SPECIAL = ["quick", "steering"];
/** Drives with a quick return, and the field of its size. */
export const SIZES = {
  four_bar: { field: "swing", says: ["Rocker swings", "°"] },
  crank_slider: { field: "stroke", says: ["Slider's stroke", "length"] },
};
/** True; throws if a drive does not make such a function. */
function checkDrive(name, drive) {
  if (name === "quick" && !(drive in SIZES))
    throw new Error("A quick return is made by a four-bar or by a crank that moves a slider: choose one of these.");
  if (name === "steering" && drive !== "four_bar") throw new Error("Steering is made by a four-bar: choose it.");
  return true;
}
/** Return the sign that follows a number of a unit. */
const sign = (unit) => (unit === TRAVEL ? "" : "°");
const DRAWN = 41; // samples of a drawn curve
export const PAD = { width: 320, height: 200, border: 8 };

/** The table that the service has read last; `pairs.changed()` is called when it has. */
export const pairs = new Pairs(() => {});

/** The fields of the form that hold a law. */
export const lawFields = () => [...document.querySelectorAll("[data-law]")];

/** The law with which the form begins. */
export function firstLaw() {
  const entries = lawFields().map((field) => {
    const { id, type, defaultChecked, options, defaultValue } = field;
    return [id, type === "checkbox" ? defaultChecked : options ? options[0].value : defaultValue];
  });
  return { ...Object.fromEntries(entries), drawn: [] };
}

/** A law of a link or draft. Throws Error for anything else. */
export function soundLaw(content) {
  const law = firstLaw();
  for (const name of Object.keys(law)) if (typeof content[name] === typeof law[name]) law[name] = content[name];
  const isPoint = (point) => Array.isArray(point) && point.length === 2 && point.every(Number.isFinite);
  law.drawn = Array.isArray(law.drawn) ? law.drawn.filter(isPoint) : [];
  if (!DRIVES[law.drive] || ![...$("name").options].some(({ value }) => value === law.name))
    throw new Error("The link belongs to another page or version.");
  return law;
}

/** The drawn curve at even x, smoothed over its neighbours: [[x, y], ...] with both in 0 .. 1. */
function drawnTable(stroke) {
  if (stroke.length < 3) throw new Error("Draw the function from left to right first.");
  const [xs, ys] = [0, 1].map((i) => stroke.map((point) => point[i])),
    step = (xs.at(-1) - xs[0]) / (DRAWN - 1),
    heights = Array.from({ length: DRAWN }, (_, n) => 1 - between(xs, ys, xs[0] + n * step) / PAD.height);
  const smooth = (values) =>
    values.map((value, n) => (n && n < values.length - 1 ? (values[n - 1] + 2 * value + values[n + 1]) / 4 : value));
  return smooth(smooth(smooth(heights))).map((y, n) => [n / (DRAWN - 1), Number(y.toFixed(6))]);
}

/** Return true if a function is given by the rows of a table. */
export const isTable = ({ name }) => ["table", "pairs"].includes(name);

/** The rows of a law's table, {x, y} or {output, input}. Throws Error if they cannot be used. */
export const rowsOf = ({ table, name }) => pairs.of(table, name === "table");

/** The part of a request that describes the function; angles that are given are requested as they are. */
function wantedOf(law, number) {
  const { name, drive } = law;
  if (name === "quick")
    return { quick_return: { [SIZES[drive]?.field ?? "swing"]: number("stroke"), time_ratio: number("time-ratio") } };
  if (name === "steering")
    return { steering: { track: number("track"), wheelbase: number("wheelbase"), angle: number("inner") } };
  const dials = { output_span: number("output-span") },
    crank_span = number("crank-span");
  if (name === "drawn") return { function: { ...dials, table: drawnTable(law.drawn) }, crank_span };
  if (isTable(law)) {
    const { x, y, input, output } = rowsOf(law);
    if (x) return { function: { ...dials, table: x.map((value, k) => [value, y[k]]) }, crank_span };
    return { output, ...(input ? { input } : { crank_span }) };
  }
  const exponent = name === "power" ? { exponent: number("exponent") } : {};
  return { function: { ...dials, name, x: [number("x0"), number("x1")], ...exponent }, crank_span };
}

function build({ law, limits, top, round }) {
  const { name, drive } = law,
    { asks } = DRIVES[drive],
    isFourBar = drive === "four_bar",
    special = SPECIAL.includes(name) && checkDrive(name, drive),
    number = (id) => numberOf($(id), law[id]),
    { crank_span, ...fields } = wantedOf(law, number);
  if (fields.output) pairs.check(asks);
  const limitFields = { ...practical(limits, false), ...(isFourBar ? { family: limits.family ?? "any" } : {}) },
    length = number(isFourBar ? "ground" : "pivots");
  if (length !== null && name !== "steering" && (isFourBar || asks.mechanisms[0] === "swinging_block"))
    limitFields.links = { ground: length };
  if (number("offset") !== null && asks.mechanisms?.[0] === "slider_crank") limitFields.offset = number("offset");
  return {
    ...fields,
    ...(crank_span === undefined ? {} : { [asks.input_unit ? "travel_span" : "crank_span"]: crank_span }),
    ...(special ? {} : asks),
    ...(name === "quick" ? {} : { objective: law.objective }),
    limits: limitFields,
    top,
    curves: true,
    ...(law["one-way"] && !special ? { one_way: true } : {}),
    ...(round && isFourBar ? { round_to: round } : {}),
  };
}

/** The body of POST /v2/function; null if the law cannot be requested, see `lawFault`. */
export function lawRequest(motion) {
  try {
    return build(motion);
  } catch {
    return null;
  }
}

/** The reason why a law cannot be solved, as [sentence, field id]; null if there is none. */
export function lawFault(motion) {
  try {
    build(motion);
    return null;
  } catch (error) {
    return [error.message, error.id ?? "function"];
  }
}

/**
 * An answer of the service as the workspace shows it. `within` is a request of /v2/synthesize over the same interval,
 * with which layers, drives and files are requested; each solution has its `output`, {input, error, samples, from,
 * signs, unitOfY, isRocker}, and its largest error as words, `off`.
 */
export function lawAnswer(motion, request, reply) {
  const { asks } = DRIVES[motion.law.drive],
    signs = [sign(asks.input_unit), request.quick_return?.stroke ? "" : sign(asks.output_unit)],
    ends = [reply.input[0], reply.input.at(-1)],
    inputs = request.input ?? [ends[0], (ends[0] + ends[1]) / 2, ends[1]], // three samples or more, as in a motion
    travels = inputs.map((value) => value - inputs[0]);
  const range = Math.max(...reply.output) - Math.min(...reply.output),
    unitOfY = reply.y && range ? (Math.max(...reply.y) - Math.min(...reply.y)) / range : null;
  const positions = travels.map((value) => [value, 0]); // any line: the linkage is given
  const within = {
    rotation: travels.map(() => 0),
    ...(asks.input_unit ? { travel: travels } : { crank_angle: travels }),
    ...(asks.mechanisms ? { mechanisms: asks.mechanisms, position: positions } : {}),
    limits: { family: "any" },
  };
  const samples = { input: reply.input, output: reply.output };
  for (const solution of reply.solutions) {
    const { errors, error_curve: curve, rounded, links } = solution;
    solution[asks.input_unit ? "travel" : "crank_angle"] = travels;
    solution.off = errorText(errors.max, signs[1] ? 57 : range, signs[1] || ` ${motion.unit}`);
    solution.output = { ...curve, samples, from: inputs[0], signs, unitOfY, isRocker: Boolean(links) };
    Object.assign(errors, { rotation_rms: null, position_rms: null });
    if (rounded?.errors) Object.assign(rounded.errors, { position_max: null, rotation_max: rounded.errors.max });
  }
  return { request, reply, within, motion };
}

/** The value of a curve [x, y] at x, between its points in a straight line; x may fall. */
function between(xs, ys, x) {
  const heading = Math.sign(xs.at(-1) - xs[0]) || 1,
    after = xs.findIndex((value) => heading * value >= heading * x),
    k = after < 0 ? xs.length - 1 : Math.max(1, after);
  return ys[k - 1] + ((ys[k] - ys[k - 1]) * (x - xs[k - 1])) / (xs[k] - xs[k - 1] || 1);
}

/** Input and output of a solution of a law after a travel from the first sample, as words. */
export function reading({ output }, travel, unit) {
  const { input, error, samples, from, signs } = output,
    actual = between(samples.input, samples.output, travel) + between(input, error, travel);
  const inWords = (value, k) => (signs[k] ? `${value.toFixed(1 + k)}°` : `${text(value, 5)} ${unit}`);
  return [from + travel, actual].map(inWords).join(" → ");
}

/** Curves of a solution of a law over travels in the crank's sense: [{title, x, values}]. */
export function lawCurves({ output }, sense, unit) {
  const { input, error, samples, signs, unitOfY, isRocker } = output,
    over = (xs, ys) => ({ x: xs.map((value) => sense * value), values: ys }),
    named = signs[1] ? (isRocker ? "degrees of the rocker" : "degrees") : unit;
  const scaled = unitOfY && error.map((value) => value * unitOfY),
    curves = [
      { title: `Error (actual minus required) in ${named}`, ...over(input, error) },
      scaled && { title: "Error (actual minus required) in units of y", ...over(input, scaled) },
      { title: `Wanted output in ${named}`, ...over(samples.input, samples.output) },
    ];
  return curves.filter(Boolean);
}

/** Rows [name, value] of the errors of a solution of a law. */
export function lawRows({ errors, output, output_offset: offset, input_zero: zero }, unit) {
  const [into, out] = output.signs.map((found) => found || ` ${unit}`),
    offsetName = output.isRocker ? "Offset added to the rocker angle" : "Offset added to the output";
  const rows = [
    ["Largest error", text(errors.max, 4) + out],
    ["Root mean square error", text(errors.rms, 4) + out],
    errors.max_y !== null && ["Largest error in y", text(errors.max_y, 4)],
    errors.alternations !== null && ["Extremes as large, alternating", String(errors.alternations)],
    Number.isFinite(zero) && ["Input at the first x", text(zero, 8) + into],
    [offsetName, text(offset, 8) + out],
  ];
  return rows.filter(Boolean);
}
