// Kinematics of a body on two guides, the first driven, as in synthesis/guided/linkage.py, for drawing.
// The travel of a drive is radians, or for a slider or cylinder a length; `unit` tells them apart in the page's degrees.

import { driveTurns } from "./drive.js";
import { Linkage } from "./kinematics.js";

const RAD = Math.PI / 180;
const BEYOND = 0.12; // part of its size by which a rail or slot is drawn beyond its used ends

const add = ([a, b], [c, d]) => [a + c, b + d];
const less = ([a, b], [c, d]) => [a - c, b - d];
const times = ([a, b], k) => [a * k, b * k];
const turned = ([x, y], angle) => [x * Math.cos(angle) - y * Math.sin(angle), x * Math.sin(angle) + y * Math.cos(angle)];
const along = (angle) => [Math.cos(angle), Math.sin(angle)];
const cross = ([a, b], [c, d]) => a * d - b * c;
const dot = ([a, b], [c, d]) => a * c + b * d;
const size = ([x, y]) => Math.hypot(x, y);
const direction = ([x, y]) => Math.atan2(y, x);

const FIXED = { circle: "pivot", rail: "point", slot: "pin" };

/** The direction of `middle - radius e^{iq}`, continuous in q. */
function roundDirection(middle, radius, q) {
  const distance = size(middle), towards = direction(middle), x = q - towards;
  if (distance >= radius) return towards + Math.atan2(-radius * Math.sin(x), distance - radius + 2 * radius * Math.sin(x / 2) ** 2);
  return q - Math.PI + Math.atan2(distance * Math.sin(x), radius - distance + 2 * distance * Math.sin(x / 2) ** 2);
}

/** The linkage of a solution with guides. at(travel): as of `Linkage`; a travel that is a length comes in as that times a degree. */
export class GuidedLinkage {
  constructor(solution) {
    this.guides = solution.guides.map((one) => ({
      ...one, fixed: one[FIXED[one.guide]], body: one.body_point,
      ...(one.guide === "rail" ? { angle: one.direction * RAD } : {}), ...(one.guide === "slot" ? { angle: one.body_direction * RAD } : {}),
    }));
    this.driver = solution.driver;
    this.branch = solution.branch;
    this.turns = driveTurns(solution);
    this.start = this.turns ? solution.start * RAD : solution.start;
    this.mount = true;
    const spread = this.guides.flatMap(({ used, radius }) => (used ? [used[1] - used[0]] : [radius]));
    this.reach = Math.max(...spread, size(less(this.guides[0].body, this.guides[1].body)));
    this.turnsFully = this.turns && Array.from({ length: 721 }, (_, k) => this.#pose(this.start + (k * Math.PI) / 360)).every(Boolean);
  }

  /** {rotation, place, sine, transmission} of the body at the drive's coordinate; null where the loop does not close. */
  #pose(q) {
    const [driven, other] = this.guides, side = this.branch;
    if (this.driver === "hinge") return this.#byHinge(q);
    const pin = driven.guide === "circle" ? add(driven.fixed, times(along(q), driven.radius)) : driven.guide === "rail" ? add(driven.fixed, times(along(driven.angle), q)) : driven.fixed;
    const onBody = driven.guide === "slot" ? add(driven.body, times(along(driven.angle), q)) : driven.body;
    const spread = less(other.fixed, pin), arm = less(other.body, onBody), distance = size(spread), length = size(arm);
    const straight = (vector) => driven.angle + direction(turned(vector, -driven.angle)); // continuous along the drive's line
    const way = driven.guide === "circle" ? roundDirection(less(other.fixed, driven.fixed), driven.radius, q) : driven.guide === "rail" ? straight(spread) : direction(spread);
    const bent = driven.guide === "slot" ? straight(arm) : direction(arm);
    let rotation, sine, cosine;
    if (other.guide === "circle") {
      const r = other.radius, total = distance + length + r, beyond = length + r - distance, lessArm = distance + r - length, lessRadius = distance + length - r;
      if (!(beyond >= 0 && lessArm >= 0 && lessRadius >= 0 && distance > 0 && length > 0)) return null;
      rotation = way + side * 2 * Math.atan2(Math.sqrt(beyond * lessArm), Math.sqrt(total * lessRadius)) - bent;
      sine = 2 * Math.sqrt(total * beyond) * Math.sqrt(lessArm * lessRadius);
      cosine = total * beyond - lessArm * lessRadius;
    } else {
      const rail = other.guide === "rail", whole = rail ? length : distance, beside = cross(along(other.angle), rail ? spread : arm);
      const square = (whole - beside) * (whole + beside);
      if (!(square >= 0 && whole > 0)) return null;
      const root = Math.sqrt(square), push = Math.atan2(beside, root), angle = side > 0 ? push : Math.PI - push;
      rotation = rail ? other.angle + angle - bent : way - angle - other.angle;
      [sine, cosine] = [root, beside];
    }
    return { rotation, place: less(pin, turned(onBody, rotation)), transmission: Math.atan2(sine, Math.abs(cosine)) };
  }

  #byHinge(q) {
    const [driven, other] = this.guides, rotation = q - driven.angle;
    const between = turned(less(driven.fixed, other.fixed), -q), arm = turned(less(other.body, driven.body), -driven.angle), free = add(between, arm);
    let extension, sine, cosine;
    if (other.guide === "circle") {
      const square = (other.radius - free[1]) * (other.radius + free[1]);
      if (!(square >= 0)) return null;
      [sine, cosine] = [Math.sqrt(square), free[1]];
      extension = free[0] - this.branch * sine;
    } else {
      const rail = other.guide === "rail", tilt = rail ? other.angle - q : other.angle - driven.angle;
      [sine, cosine] = [-Math.sin(tilt), Math.cos(tilt)];
      if (!sine || (rail && Math.sign(sine) !== this.branch)) return null;
      extension = turned(free, -tilt)[1] / sine;
    }
    const onBody = add(driven.body, times(along(driven.angle), extension));
    return { rotation, place: less(driven.fixed, turned(onBody, rotation)), transmission: Math.atan2(Math.abs(sine), Math.abs(cosine)) };
  }

  at(travel) {
    const q = this.start + (this.turns ? travel : travel / RAD), pose = this.#pose(q);
    if (!pose) return null;
    const { rotation, place, transmission } = pose, rails = [], slots = [], blocks = [];
    const ends = this.guides.map((one) => {
      const body = add(place, turned(one.body, rotation));
      if (one.guide === "circle") return [one.fixed, body];
      const margin = BEYOND * this.reach, [low, high] = one.used ?? [0, 0], reach = [low - margin, high + margin];
      if (one.guide === "rail") {
        rails.push(reach.map((s) => add(one.fixed, times(along(one.angle), s))));
        blocks.push([body, one.angle]);
        return [rails.at(-1)[1], body];
      }
      const angle = one.angle + rotation, line = reach.map((s) => add(body, times(along(angle), s)));
      slots.push(line);
      blocks.push([one.fixed, angle]);
      return [one.fixed, line[1]];
    });
    const [[a, d], [b, c]] = ends, circle = this.guides.map((one) => one.guide === "circle");
    return {
      travel, a, b, c, d, p: place, rotation, transmission, rails, slots, blocks,
      links: [circle[0] ? [a, d] : null, circle[1] ? [b, c] : null], fixed: this.guides.map((one) => one.guide !== "rail"), size: this.reach,
    };
  }

  /** As of `Linkage`. */
  over(first, last, steps = 180) {
    return Array.from({ length: steps + 1 }, (_, k) => this.at(first + ((last - first) * k) / steps));
  }
}

/** The linkage of a solution, a four-bar or one with guides alone. */
export const linkageOf = (solution) => (solution.links ? new Linkage(solution) : new GuidedLinkage(solution));

/** The guides that lie as joints {a, b, c, d, p, rotation} say, and where the drive then is; null for what is none. */
export function guidesFrom({ a, b, c, d, p, rotation }, { guides, driver }) {
  const made = [[a, d], [b, c]].map(([fixed, held], k) => {
    const { guide } = guides[k], reach = less(held, fixed), local = turned(less(held, p), -rotation);
    if (!(size(reach) > 0)) return null;
    if (guide === "circle") return { guide, pivot: fixed, radius: size(reach), body_point: local };
    if (guide === "rail") {
      const old = guides[k].direction, found = direction(less(fixed, held)) / RAD;
      return { guide, point: held, direction: found + 180 * Math.round((old - found) / 180), body_point: local, used: null };
    }
    const old = guides[k].body_direction, found = (direction(reach) - rotation) / RAD;
    return { guide, pin: fixed, body_point: turned(less(fixed, p), -rotation), body_direction: found + 180 * Math.round((old - found) / 180), used: null };
  });
  if (!made.every(Boolean)) return null;
  const [driven, other] = made, place = (one) => add(p, turned(one.body_point, rotation));
  const slot = (one) => one.body_direction * RAD + rotation;
  const start = { crank: () => direction(less(place(driven), driven.pivot)) / RAD, slider: () => 0, cylinder: () => 0, hinge: () => slot(driven) / RAD }[driver]();
  const push = other.guide === "circle" ? less(place(other), other.pivot) : other.guide === "rail" ? turned(along(other.direction * RAD), Math.PI / 2) : turned(along(slot(other)), Math.PI / 2);
  const at = other.guide === "slot" ? other.pin : place(other), pin = driven.guide === "slot" ? driven.pin : place(driven);
  const sine = driver === "hinge" ? dot(push, along(slot(driven))) : cross(less(at, pin), push);
  return { guides: made, start, branch: sine < 0 ? -1 : 1 };
}

/** Guides with the parts of rails and slots that poses (joints of `at`) use. */
export function withUsed(linkage, joints) {
  return linkage.guides.map(({ fixed, body, angle, ...one }) => {
    if (one.guide === "circle") return one;
    const places = joints.filter(Boolean).map((j) => {
      const held = add(j.p, turned(body, j.rotation));
      return one.guide === "rail" ? dot(along(angle), less(held, fixed)) : dot(along(angle + j.rotation), less(fixed, held));
    });
    return { ...one, used: places.length ? [Math.min(...places), Math.max(...places)] : null };
  });
}
