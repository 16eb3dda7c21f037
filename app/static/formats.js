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

/** A number for each pose where at least one has its own, `whole` for the others; otherwise `whole`. */
function perPose(poses, name, whole) {
  if (poses.every((pose) => pose[name] === undefined)) return whole;
  const largest = Math.max(...poses.map((pose) => pose[name] ?? 0));
  return poses.map((pose) => pose[name] ?? whole ?? largest);
}

/** {rotation, position} without what is null; undefined if nothing is left. */
function present(rotation, position) {
  const both = { ...(rotation === null ? {} : { rotation }), ...(position === null ? {} : { position }) };
  return Object.keys(both).length ? both : undefined;
}

/** The body of POST /v2/synthesize, or of POST /v2/function for a law; null if a law cannot be requested. */
export function toRequest(motion) {
  if (motion.law) return lawRequest(motion);
  const { poses, limits, tolerance } = motion;
  const angles = wantsAngles(motion),
    places = wantsPlaces(motion);
  const request = { ...motion.extra };
  if (angles) request.rotation = poses.map((pose) => pose.angle);
  if (places) request.position = poses.map(placeOf);
  if (motion.timing === "even") request.crank_span = motion.direction * motion.span;
  else if (motion.timing === "table") request.crank_angle = poses.map((pose) => motion.direction * pose.t);
  else {
    request.timing = "free";
    if (motion.anyOrder) request.order = "any";
    if (motion.closed) request.closed = true;
    if (motion.spanMax) request.crank_span_max = motion.spanMax;
  }
  const unweighted = (name) =>
    poses.every((pose) => pose[name] === undefined) ? null : poses.map((pose) => pose[name] ?? 1);
  if (motion.timing !== "free" && motion.startAngle !== null) request.start_angle = motion.startAngle;
  const weights = present(angles ? unweighted("wr") : null, places ? unweighted("wp") : null);
  if (weights) request.weights = weights;
  const tolerances = present(
    angles ? perPose(poses, "er", tolerance.rotation) : null,
    places ? perPose(poses, "ep", tolerance.position) : null,
  );
  if (tolerances) request.tolerances = tolerances;
  if (motion.prefer && preferable(motion, motion.prefer)) request.prefer = motion.prefer;
  request.top = motion.top;
  if (motion.diverse) request.diverse = true;
  // unless other kinds are asked for, a box for the pivots means hinges only
  const kinds =
    request.start_angle !== undefined
      ? "four_bar"
      : motion.mechanisms === "auto"
        ? limits.box
          ? "four_bar"
          : "all"
        : motion.mechanisms;
  if (kinds !== "four_bar" && slidable(motion)) request.mechanisms = kinds === "all" ? "all" : [kinds].flat();
  const asked = { ...limits.extra, ...practical(limits, motion.timing === "free") };
  if (limits.family) asked.family = limits.family;
  if (limits.box && places) asked.pivot_box = limits.box;
  if (limits.min) asked.link_min = limits.min;
  if (limits.max) asked.link_max = limits.max;
  if (Object.keys(asked).length) request.limits = asked;
  if (motion.round && places) request.round_to = motion.round;
  else if (motion.stock?.length && places) request.lengths_from = motion.stock;
  const analysis = analysisOf(motion, places);
  if (analysis) request.analysis = analysis;
  const { extra: how, ...sizes } = motion.study,
    sized = Object.entries(sizes).filter(([, value]) => value !== null);
  if (sized.length && places) request.tolerance_study = { ...Object.fromEntries(sized), ...how };
  return request;
}

/** The opposite of `practical`: {kept, transmission, turn, ratio}. */
function readPractical(limits, unit, free) {
  const preset = (limits.preset ?? (free ? "practical" : "none")) === "practical",
    read = { kept: { reach: preset } };
  for (const [name, own, field, none] of REPLACED) {
    const given =
      limits[field] === undefined || limits[field] === null ? null : limits[field] * (name === "ratio" ? 1 : unit);
    const off = given === null ? !preset : given === none;
    read.kept[name] = !off;
    read[own] = off ? null : given;
  }
  return read;
}

/** The analysis that a motion asks for; its speed is in the sense of the crank where that is known. */
function analysisOf({ analysis: { speed, force, torque }, timing, direction }, places) {
  if (speed === null) return null;
  const load = {};
  if (places && force.some((part) => part)) load.force = force.map((part) => part ?? 0);
  if (torque) load.torque = torque;
  return { crank_speed: timing === "free" ? speed : direction * speed, ...(Object.keys(load).length ? { load } : {}) };
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
function spread(part, poses, names, unit, what) {
  const whole = {};
  for (const [k, side] of ["rotation", "position"].entries()) {
    const value = part?.[side] ?? null,
      scale = k === 0 ? unit : 1;
    whole[side] = Number.isFinite(value) ? value * scale : null;
    if (!Array.isArray(value)) continue;
    if (!isNumbers(value) || value.length !== poses.length)
      throw new Error(`The request has ${counted(poses.length, "pose")} but not as many ${what}.`);
    value.forEach((entry, at) => {
      poses[at][names[k]] = entry * scale;
    });
  }
  return whole;
}

/** What a link and a draft hold of a motion: its request or its law, and what else the page shows of it. */
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

/** The motion of a request. Throws Error for anything that is not a request. */
export function fromRequest(body) {
  const {
    rotation,
    position,
    crank_span,
    crank_angle,
    timing,
    order,
    closed,
    crank_span_max,
    start_angle,
    weights,
    tolerances,
    prefer,
    limits = {},
    round_to,
    lengths_from,
    analysis,
    tolerance_study,
    top,
    diverse,
    mechanisms,
    angle_unit,
    ...extra
  } = body ?? {};
  const unit = angle_unit === "rad" ? 180 / Math.PI : 1,
    free =
      timing === "free" || (!isNumber(crank_span) && !crank_angle && !!position && !extra.travel && !extra.travel_span);
  if (extra.function || extra.output || extra.quick_return || extra.steering)
    throw new Error("This is a request for a function: choose it under Function, or send it to POST /v2/function.");
  const count = (rotation ?? position)?.length;
  if (!count || (rotation && !isColumn(rotation, isNumber)) || (position && !isColumn(position, isPlace)))
    throw new Error("This is not a request: it has neither a rotation nor positions.");
  if (rotation && position && rotation.length !== position.length)
    throw new Error(`There are ${counted(rotation.length, "angle")} and ${counted(position.length, "position")}.`);
  if (crank_angle && !(isNumbers(crank_angle) && crank_angle.length === count))
    throw new Error(`The request has ${counted(count, "pose")} but not as many crank angles.`);
  if (!free && !crank_angle && !isNumber(crank_span))
    throw new Error("The request has no crank span, and its crank angles are not free.");
  const motion = emptyMotion(rotation && position ? "both" : rotation ? "rotation" : "position");
  motion.timing = free ? "free" : crank_angle ? "table" : "even";
  if (free)
    Object.assign(motion, {
      anyOrder: order === "any",
      closed: closed === true,
      spanMax: crank_span_max ? crank_span_max * unit : null,
    });
  else {
    const whole = (crank_angle ? crank_angle.at(-1) - crank_angle[0] : crank_span) * unit;
    motion.direction = whole < 0 ? -1 : 1;
    motion.span = Math.abs(whole);
    motion.startAngle = start_angle === undefined || start_angle === null ? null : start_angle * unit;
  }
  motion.poses = Array.from({ length: count }, (_, k) => ({
    t: crank_angle ? Math.abs(crank_angle[k] - crank_angle[0]) * unit : 0,
    x: position ? (position[k]?.[0] ?? null) : 0,
    y: position ? (position[k]?.[1] ?? null) : 0,
    angle: !rotation ? 0 : rotation[k] === null ? null : rotation[k] * unit,
  }));
  fixTravels(motion);
  spread(weights, motion.poses, ["wr", "wp"], 1, "weights");
  motion.tolerance = spread(tolerances, motion.poses, ["er", "ep"], unit, "tolerances");
  const {
    family,
    pivot_box,
    link_min,
    link_max,
    preset,
    transmission_angle_min,
    transmission_angle_min_turn,
    link_ratio_max,
    ...more
  } = limits;
  motion.limits = {
    family: family ?? null,
    ...readPractical({ preset, transmission_angle_min, transmission_angle_min_turn, link_ratio_max }, unit, free),
    box: pivot_box ?? null,
    min: link_min ?? null,
    max: link_max ?? null,
    extra: more,
  };
  motion.diverse = diverse === true;
  motion.mechanisms = Array.isArray(mechanisms) && mechanisms.length === 1 ? mechanisms[0] : (mechanisms ?? "four_bar");
  motion.prefer = prefer ?? null;
  motion.round = round_to ?? null;
  motion.stock = isNumbers(lengths_from) ? lengths_from : null;
  if (analysis) {
    const speed = (analysis.crank_speed ?? 0) * unit;
    motion.analysis = {
      speed: free ? speed : motion.direction * speed,
      force: analysis.load?.force ?? [null, null],
      torque: analysis.load?.torque ?? null,
    };
  }
  const { links = null, pivots = null, clearance = null, ...how } = tolerance_study ?? {};
  if (tolerance_study) motion.study = { links, pivots, clearance, extra: how };
  motion.top = top ?? 8;
  delete extra.budget_ms;
  delete extra.start_from; // linkages, and no part of the motion
  delete extra.refine_only;
  motion.extra = extra;
  const { min, max, transmission, turn, ratio, box } = motion.limits,
    { speed, force, torque } = motion.analysis;
  const numbers = [
    min,
    max,
    transmission,
    turn,
    ratio,
    motion.spanMax,
    motion.startAngle,
    motion.round,
    motion.top,
    speed,
    torque,
    links,
    pivots,
    clearance,
    ...force,
  ];
  if (
    !numbers.every((value) => value === null || isNumber(value)) ||
    !(box === null || (isNumbers(box) && box.length === 4))
  )
    throw new Error("The request has something else where a number is needed.");
  return motion;
}
