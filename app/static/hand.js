// A linkage changed by hand: from joints that were dragged to its dimensions and its errors.

import { fitOf } from "./fit.js";
import { Linkage, family } from "./kinematics.js";
import { placesOf } from "./motion.js";
import { RAD, add, along, cross, direction, dot, less, size, turned } from "./plane.js";

const COINCIDE = 1e-9; // joints this part of the longest link apart are one
const OF_SERVICE =
  "rank verdict rounded analysis tolerance_study excursion transmission_angle_min_turn arm_min sensitivity " +
  "determination has_smallest_error";
/** Results of the service for a solution, which are invalid once the solution has been changed. */
export const UNKNOWN = Object.fromEntries(OF_SERVICE.split(" ").map((name) => [name, null]));

const wrap = (angle) => Math.atan2(Math.sin(angle), Math.cos(angle));

/**
 * The solution whose joints, with the crank turned by `travel` degrees from its start, are `joints`, {a, b, c, d, p,
 * rotation}; the body keeps its direction. Null where two joints coincide.
 */
export const fromJoints = (joints, travel, before) =>
  before.links ? fourBarFrom(joints, travel, before) : guidedFrom(joints, travel, before);

/** A guide through two joints; null where they coincide. */
function guideFrom({ guide, ...before }, fixed, bodyPoint, { p, rotation }) {
  const reach = less(bodyPoint, fixed),
    local = (point) => turned(less(point, p), -rotation),
    near = (angle, old) => angle / RAD + 180 * Math.round((old - angle / RAD) / 180);
  if (!(size(reach) > 0)) return null;
  if (guide === "circle") return { guide, pivot: fixed, radius: size(reach), body_point: local(bodyPoint) };
  const away = direction(guide === "rail" ? less(fixed, bodyPoint) : reach);
  return guide === "rail"
    ? { guide, point: bodyPoint, direction: near(away, before.direction), body_point: local(bodyPoint), used: null }
    : {
        guide,
        pin: fixed,
        body_direction: near(away - rotation, before.body_direction),
        body_point: local(fixed),
        used: null,
      };
}

/** Return the solution with rails or slots at the given joints: each guide goes through its two joints. */
function guidedFrom(joints, travel, before) {
  const { a, b, c, d, p, rotation } = joints,
    driven = guideFrom(before.guides[0], a, d, joints),
    secondGuide = guideFrom(before.guides[1], b, c, joints),
    hinged = before.driver === "hinge";
  if (!driven || !secondGuide) return null;
  const pinOf = (guide) => guide.pin ?? add(p, turned(guide.body_point, rotation)),
    slot = (guide) => guide.body_direction * RAD + rotation,
    angle = hinged ? slot(driven) : before.driver === "crank" ? direction(less(pinOf(driven), driven.pivot)) : 0;
  const across = (guide) => along((guide.guide === "rail" ? guide.direction * RAD : slot(guide)) + Math.PI / 2),
    push = secondGuide.guide === "circle" ? less(pinOf(secondGuide), secondGuide.pivot) : across(secondGuide),
    sine = hinged ? dot(push, along(slot(driven))) : cross(less(pinOf(secondGuide), pinOf(driven)), push),
    placed = { start: angle / RAD - travel, branch: sine < 0 ? -1 : 1 };
  const changed = { ...before, ...UNKNOWN, ...placed, source: "hand", guides: [driven, secondGuide] };
  return new Linkage(changed).at(travel * RAD) && changed;
}

function fourBarFrom({ a, b, c, d, p, rotation }, travel, before) {
  const sides = { crank: less(d, a), coupler: less(c, d), rocker: less(c, b), ground: less(b, a) },
    links = Object.fromEntries(Object.entries(sides).map(([name, side]) => [name, size(side)])),
    lengths = Object.values(links);
  if (!(Math.min(...lengths) > COINCIDE * Math.max(...lengths))) return null;
  const turn = direction(sides.ground),
    angle = p && wrap(direction(less(p, d)) - direction(sides.coupler)) / RAD,
    coupler_point_polar = p ? { radius: size(less(p, d)), angle } : null;
  const changed = {
    ...before,
    ...UNKNOWN,
    source: "hand",
    links,
    branch: cross(less(b, d), sides.coupler) < 0 ? -1 : 1,
    start_angle: wrap(direction(sides.crank) - turn) / RAD - travel,
    body_offset: 0,
    mount: { ground_angle: turn / RAD, pivot_a: a, pivot_b: b, coupler_point_polar },
    family: family(lengths),
  };
  const now = new Linkage(changed).at(travel * RAD);
  return now && { ...changed, body_offset: before.body_offset === null ? null : (rotation - now.coupler) / RAD };
}

/** Guides with the parts of rails and slots that poses (joints of `at`) use. */
function withUsed(linkage, joints) {
  return linkage.guides.map(({ fixed, body, angle, ...guide }) => {
    if (guide.guide === "circle") return guide;
    const positions = joints.filter(Boolean).map((j) => {
      const beyond = less(add(j.p, turned(body, j.rotation)), fixed);
      return guide.guide === "rail" ? dot(along(angle), beyond) : -dot(along(angle + j.rotation), beyond);
    });
    return { ...guide, used: positions.length ? [Math.min(...positions), Math.max(...positions)] : null };
  });
}

const present = (values) => values.filter((value) => value !== null);
const rms = (values) =>
  values.length ? Math.sqrt(values.reduce((sum, value) => sum + value ** 2, 0) / values.length) : null;
const largest = (values) => (values.length ? Math.max(...values.map(Math.abs)) : null);
const middleOf = (points) => [0, 1].map((i) => points.reduce((sum, point) => sum + point[i], 0) / (points.length || 1));
const scaleOf = (points) => Math.max(...points.map((point) => size(less(point, middleOf(points)))), Number.MIN_VALUE);

/** A solution with errors, transmission angle and size computed in the browser; its `fit`, and whether it `closes`. */
export function measured(solution, motion) {
  const targets = placesOf(motion),
    scale = scaleOf(targets),
    fit = fitOf(solution, motion),
    { sense, low, high } = fit.pass,
    used = fit.linkage.over(sense * low * RAD, sense * high * RAD, 90),
    isClosed = used.every(Boolean),
    [distances, turns] = [present(fit.places), present(fit.turns)];
  const updated = solution.links ? solution : { ...solution, guides: withUsed(fit.linkage, used) },
    { mount } = updated,
    away = (point) => size(less(point, middleOf(targets)));
  const radius = mount?.coupler_point_polar?.radius ?? 0,
    reach = () => Math.max(...Object.values(updated.links), radius, away(mount.pivot_a), away(mount.pivot_b));
  const errors = {
    position_rms: rms(distances),
    position_max: largest(distances),
    rotation_rms: rms(turns),
    rotation_max: largest(turns),
    objective: Math.hypot((rms(distances) ?? 0) / scale, (rms(turns) ?? 0) * RAD),
  };
  const transmission_angle_min = isClosed ? Math.min(...used.map((j) => j.transmission)) / RAD : 0,
    extent = targets.length && mount ? reach() / scale : null;
  return {
    fit,
    closes: isClosed && fit.at.every(Boolean),
    solution: { ...updated, size: extent, transmission_angle_min, errors },
  };
}

/** A request to refine a solution from just there. */
export function fromHere(request, { links, branch, start_angle, body_offset, mount, crank_angle }) {
  const { diverse: _diverse, prefer: _prefer, mechanisms: _mechanisms, ...options } = request,
    begun = { links, branch, start_angle, body_offset, mount, crank_angle };
  return { ...options, top: 1, refine_only: true, start_from: [begun] };
}
