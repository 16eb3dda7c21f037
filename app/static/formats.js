// The motion as a request and as what a link or a draft holds of it, and back.

import { lawRequest, soundLaw } from "./law.js";
import {
  REPLACED,
  UNITS,
  emptyMotion,
  fixTravels,
  placeOf,
  practical,
  preferable,
  slidable,
  wantsAngles,
  wantsPlaces,
} from "./motion.js";
import { counted } from "./shell.js";

/** Return a number for each pose if a pose has its own, with `common` for the others; otherwise `common`. */
function perPose(poses, name, common) {
  if (poses.every((pose) => pose[name] === undefined)) return common;
  const largest = Math.max(...poses.map((pose) => pose[name] ?? 0));
  return poses.map((pose) => pose[name] ?? common ?? largest);
}

/** An object without the entries that are null or undefined; undefined if nothing is left. */
function present(entries) {
  const found = Object.entries(entries).filter(([, value]) => value !== null && value !== undefined);
  return found.length ? Object.fromEntries(found) : undefined;
}

/** The kinds of linkages to search for; unless others are asked for, a box for the pivots means hinges only. */
function mechanismsOf({ mechanisms, timing, startAngle, limits }) {
  if (timing !== "free" && startAngle !== null) return "four_bar";
  if (mechanisms === "auto") return limits.box ? "four_bar" : "all";
  return mechanisms;
}

/** The body of POST /v2/synthesize, or of POST /v2/function for a law; null if a law cannot be requested. */
export function toRequest(motion) {
  if (motion.law) return lawRequest(motion);
  const { poses, limits, tolerance, timing, direction, prefer, stock } = motion,
    [angles, hasPositions, free] = [wantsAngles(motion), wantsPlaces(motion), timing === "free"],
    own = (name) => poses.some((pose) => pose[name] !== undefined),
    weights = (name) => (own(name) ? poses.map((pose) => pose[name] ?? 1) : null),
    kinds = mechanismsOf(motion),
    { extra: how, ...sizes } = motion.study;
  const { family, box, min, max } = limits;
  const timed = free
    ? { timing, order: motion.anyOrder ? "any" : null, closed: motion.closed || null, crank_span_max: motion.spanMax }
    : {
        crank_span: timing === "even" ? direction * motion.span : null,
        crank_angle: timing === "table" ? poses.map((pose) => direction * pose.t) : null,
        start_angle: motion.startAngle,
      };
  const limitFields = {
    ...limits.extra,
    ...practical(limits, free),
    ...present({ family, pivot_box: hasPositions ? box : null, link_min: min || null, link_max: max || null }),
  };
  return {
    ...motion.extra,
    ...present({
      rotation: angles ? poses.map((pose) => pose.angle) : null,
      position: hasPositions ? poses.map(placeOf) : null,
      ...timed,
      weights: present({ rotation: angles ? weights("wr") : null, position: hasPositions ? weights("wp") : null }),
      tolerances: present({
        rotation: angles ? perPose(poses, "er", tolerance.rotation) : null,
        position: hasPositions ? perPose(poses, "ep", tolerance.position) : null,
      }),
      prefer: prefer && preferable(motion, prefer) ? prefer : null,
      top: motion.top,
      diverse: motion.diverse || null,
      mechanisms: kinds === "four_bar" || !slidable(motion) ? null : kinds === "all" ? kinds : [kinds].flat(),
      limits: present(limitFields),
      round_to: hasPositions ? motion.round || null : null,
      lengths_from: hasPositions && !motion.round && stock?.length ? stock : null,
      analysis: analysisOf(motion, hasPositions),
      tolerance_study: hasPositions && present(sizes) ? { ...present(sizes), ...how } : null,
    }),
  };
}

/** The opposite of `practical`: {kept, transmission, turn, ratio}. */
function readPractical(limits, unit, free) {
  const preset = (limits.preset ?? (free ? "practical" : "none")) === "practical",
    read = { kept: { reach: preset } };
  for (const [name, own, field, none] of REPLACED) {
    const value = limits[field] ?? null,
      converted = value === null ? null : value * (name === "ratio" ? 1 : unit),
      off = converted === null ? !preset : converted === none;
    read.kept[name] = !off;
    read[own] = off ? null : converted;
  }
  return read;
}

/** The analysis that a motion asks for; its speed is in the sense of the crank where that is known. */
function analysisOf({ analysis: { speed, force, torque }, timing, direction }, hasPositions) {
  if (speed === null) return null;
  const acts = hasPositions && force.some(Boolean),
    load = present({ force: acts ? force.map((part) => part ?? 0) : null, torque: torque || null });
  return { crank_speed: timing === "free" ? speed : direction * speed, ...(load && { load }) };
}

/** A request as text for people: one line for each of its fields. */
export function requestText(request) {
  const rows = Object.entries(request).map(([name, value]) => `  ${JSON.stringify(name)}: ${JSON.stringify(value)}`);
  return `{\n${rows.join(",\n")}\n}`;
}

const isNumber = (value) => Number.isFinite(value) && Math.abs(value) <= 1e50;
const isNumbers = (list) => Array.isArray(list) && list.every(isNumber);
const isPlace = (value) => isNumbers(value) && value.length === 2;
const isColumn = (list, good) => Array.isArray(list) && list.every((entry) => entry === null || good(entry));

/** Puts the lists of `part` ({rotation, position}) into the poses as `names`; returns what is not a list. */
function spread(part, poses, names, unit, label) {
  const common = {};
  for (const [k, side] of ["rotation", "position"].entries()) {
    const value = part?.[side] ?? null,
      scale = k === 0 ? unit : 1;
    common[side] = Number.isFinite(value) ? value * scale : null;
    if (!Array.isArray(value)) continue;
    if (!isNumbers(value) || value.length !== poses.length)
      throw new Error(`The request has ${counted(poses.length, "pose")} but not as many ${label}.`);
    for (const [at, entry] of value.entries()) poses[at][names[k]] = entry * scale;
  }
  return common;
}

/** Return the content of a link or draft of a motion: its request or law, and the other data that the page shows. */
export const toPage = (request, { unit, outline, mechanisms, law, limits, top, round }, card = null) => ({
  ...(law ? { law, limits, top, round } : { request }),
  page: {
    unit,
    ...(outline ? { outline } : {}),
    ...(mechanisms === "auto" ? { mechanisms } : {}),
    ...(card ? { card } : {}),
  },
});

/** The motion of a law with the limits beside it. Throws Error for anything else. */
function fromLaw({ law, limits, top, round }) {
  const motion = { ...emptyMotion("function"), law: soundLaw(law) },
    { kept, family, transmission, turn, ratio } = limits ?? {};
  const isLimit = (value) => value === null || isNumber(value);
  if (Object.values(kept ?? {}).every((value) => typeof value === "boolean")) Object.assign(motion.limits.kept, kept);
  if ([transmission, turn, ratio].every(isLimit)) Object.assign(motion.limits, { transmission, turn, ratio });
  if (["any", "full_crank", "crank_rocker", "double_crank"].includes(family)) motion.limits.family = family;
  return Object.assign(motion, { top: isNumber(top) ? top : motion.top, round: isNumber(round) ? round : null });
}

/** {motion, card} of what `toPage` made, or of a request alone. Throws Error for anything else. */
export function fromPage(content) {
  const { request = content, law, page } = content ?? {},
    motion = law ? fromLaw(content) : fromRequest(request),
    { unit, outline, mechanisms, card = null } = page ?? {};
  if (UNITS.includes(unit)) motion.unit = unit;
  if (mechanisms === "auto") motion.mechanisms = mechanisms;
  if (Array.isArray(outline) && outline.every((line) => Array.isArray(line) && line.every(isPlace)))
    motion.outline = outline;
  return { motion, card };
}

/** Return the reason why a request does not describe a motion, as a sentence; null if it does. */
function faultOf({ rotation, position, crank_span, crank_angle, ...more }, free) {
  const count = (rotation ?? position)?.length;
  if (more.function || more.output || more.quick_return || more.steering)
    return "This is a request for a function: choose it under Function, or send it to POST /v2/function.";
  if (!count || (rotation && !isColumn(rotation, isNumber)) || (position && !isColumn(position, isPlace)))
    return "This is not a request: it has neither a rotation nor positions.";
  if (rotation && position && rotation.length !== position.length)
    return `There are ${counted(rotation.length, "angle")} and ${counted(position.length, "position")}.`;
  if (crank_angle && !(isNumbers(crank_angle) && crank_angle.length === count))
    return `The request has ${counted(count, "pose")} but not as many crank angles.`;
  if (!free && !crank_angle && !isNumber(crank_span))
    return "The request has no crank span, and its crank angles are not free.";
  return null;
}

const isNone = (value) => value === undefined || value === null;

/** Crank angles, order and sense of a motion as its request says. */
function timingOf({ crank_span, crank_angle, order, closed, crank_span_max, start_angle }, unit, free) {
  if (free) return { anyOrder: order === "any", closed: closed === true, spanMax: crank_span_max * unit || null };
  const span = (crank_angle ? crank_angle.at(-1) - crank_angle[0] : crank_span) * unit,
    startAngle = isNone(start_angle) ? null : start_angle * unit;
  return { timing: crank_angle ? "table" : "even", direction: span < 0 ? -1 : 1, span: Math.abs(span), startAngle };
}

/** Fields of a request that the motion holds otherwise, or that are no part of it. */
const HELD = [
  "rotation position crank_span crank_angle timing order closed crank_span_max start_angle weights tolerances",
  "prefer limits round_to lengths_from analysis tolerance_study top diverse mechanisms angle_unit",
  "budget_ms start_from refine_only",
];
const without = (value, names) => Object.fromEntries(Object.entries(value).filter(([name]) => !names.includes(name)));

/** The motion of a request. Throws Error for anything that is not a request. */
export function fromRequest(body) {
  const request = body ?? {},
    { rotation, position, crank_angle, limits = {}, analysis, tolerance_study, mechanisms } = request,
    unit = request.angle_unit === "rad" ? 180 / Math.PI : 1,
    timed = isNumber(request.crank_span) || crank_angle || !position || request.travel || request.travel_span,
    free = request.timing === "free" || !timed,
    fault = faultOf(request, free);
  if (fault) throw new Error(fault);
  const motion = emptyMotion(rotation && position ? "both" : rotation ? "rotation" : "position");
  Object.assign(motion, timingOf(request, unit, free));
  motion.poses = (rotation ?? position).map((_, k) => ({
    t: crank_angle ? Math.abs(crank_angle[k] - crank_angle[0]) * unit : 0,
    x: position ? (position[k]?.[0] ?? null) : 0,
    y: position ? (position[k]?.[1] ?? null) : 0,
    angle: !rotation ? 0 : rotation[k] === null ? null : rotation[k] * unit,
  }));
  fixTravels(motion);
  spread(request.weights, motion.poses, ["wr", "wp"], 1, "weights");
  motion.tolerance = spread(request.tolerances, motion.poses, ["er", "ep"], unit, "tolerances");
  const { family = null, pivot_box: box = null, link_min: min = null, link_max: max = null, ...more } = limits,
    read = ["preset", ...REPLACED.map(([, , field]) => field)];
  motion.limits = { family, box, min, max, ...readPractical(limits, unit, free), extra: without(more, read) };
  const [first = "four_bar", ...further] = [mechanisms ?? []].flat(),
    { prefer = null, round_to: round = null, lengths_from: stock, diverse } = request;
  const top = request.top ?? 8;
  Object.assign(motion, { prefer, round, top, diverse: diverse === true, stock: isNumbers(stock) ? stock : null });
  motion.mechanisms = further.length ? mechanisms : first;
  if (analysis) {
    const { force = [null, null], torque = null } = analysis.load ?? {},
      speed = (analysis.crank_speed ?? 0) * unit;
    motion.analysis = { speed: free ? speed : motion.direction * speed, force, torque };
  }
  const { links = null, pivots = null, clearance = null, ...how } = tolerance_study ?? {};
  if (tolerance_study) motion.study = { links, pivots, clearance, extra: how };
  motion.extra = without(request, HELD.join(" ").split(" "));
  const { transmission, turn, ratio } = motion.limits,
    { speed, force, torque } = motion.analysis,
    { spanMax, startAngle } = motion,
    numbers = [min, max, transmission, turn, ratio, spanMax, startAngle, round, top, speed, torque, ...force];
  const isBox = box === null || (isNumbers(box) && box.length === 4);
  if (!isBox || ![...numbers, links, pivots, clearance].every((value) => value === null || isNumber(value)))
    throw new Error("The request has a value that is not a number in a field that requires a number.");
  return motion;
}
