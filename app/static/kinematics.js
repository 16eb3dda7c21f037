// Kinematics of a planar linkage, a body on two guides of which the first is driven: the closed forms of the service.
// Angles are radians. The travel of a slider or cylinder is a length, which the page passes in as that many degrees.

import { RAD, add, along, cross, direction, less, size, times, turned } from "./plane.js";
import { driveTurns } from "./timing.js";

const TURN = 2 * Math.PI;
const BEYOND = 0.12; // length of a rail or slot beyond its used ends, as a fraction of the linkage's size
const CHANGE_POINT = 1e-12; // negligible difference of two pairings of the links, as a fraction of the longest
/** Signs of the three excesses of `family`. */
export const SIGNS = { crank_rocker: "+++", double_crank: "--+", rocker_crank: "+--", double_rocker: "-+-" };
const FULL_CRANK = ["crank_rocker", "double_crank"];
/** The name of the fixed point of each kind of guide. */
export const FIXED = { circle: "pivot", rail: "point", slot: "pin" };

function twoSum(a, b) {
  const total = a + b,
    part = total - a;
  return [total, a - (total - part) + (b - part)];
}

/** (a + b) - (c + d) with the rounding errors of both sums taken into account. */
function pairDifference(a, b, c, d) {
  const [left, leftError] = twoSum(a, b),
    [right, rightError] = twoSum(c, d);
  return left - right + (leftError - rightError);
}

/** Return the family of a four-bar of lengths crank, coupler, rocker and ground, by Grashof's rule. */
export function family(lengths) {
  if (!lengths.every((value) => Number.isFinite(value) && value > 0)) return "triple_rocker";
  const [crank, coupler, rocker, ground] = lengths;
  const excesses = [
    pairDifference(coupler, ground, crank, rocker),
    pairDifference(rocker, ground, crank, coupler),
    pairDifference(coupler, rocker, crank, ground),
  ];
  if (Math.min(...excesses.map(Math.abs)) <= CHANGE_POINT * Math.max(...lengths)) return "change_point";
  const signs = excesses.map((excess) => (excess > 0 ? "+" : "-")).join("");
  return Object.keys(SIGNS).find((name) => SIGNS[name] === signs) ?? "triple_rocker";
}

/** A vector of the loop over the coordinate q of the drive; here a vector that stays as it is. */
class Vector {
  constructor(middle) {
    Object.assign(this, { middle, distance: size(middle), towards: direction(middle) });
  }

  at() {
    return this.middle;
  }

  direction() {
    return this.towards;
  }
}

/**
 * `middle - radius e^{iq}`: from the pin of a crank to a fixed point. `longerThan` is its square less that of the
 * difference of two lengths, `shorterThan` the square of their sum less its own, `across` a length less its part to the
 * left (`side` 1) or right (-1) of a direction; the loop closes if these are not negative. Each is a sum of terms that
 * are not negative wherever the drive moves freely.
 */
class Round extends Vector {
  constructor(middle, radius) {
    super(middle);
    this.radius = radius;
  }

  at(q) {
    return less(this.middle, times(along(q), this.radius));
  }

  /** Return the angle, continuous in q. */
  direction(q) {
    const { distance, towards, radius } = this,
      x = q - towards;
    if (distance >= radius)
      return towards + Math.atan2(-radius * Math.sin(x), distance - radius + 2 * radius * Math.sin(x / 2) ** 2);
    return q - Math.PI + Math.atan2(distance * Math.sin(x), radius - distance + 2 * distance * Math.sin(x / 2) ** 2);
  }

  longerThan(q, first, second) {
    const { distance, towards, radius } = this;
    const condition = pairDifference(distance, first, radius, second) * pairDifference(distance, second, radius, first);
    return condition + 4 * distance * radius * Math.sin((q - towards) / 2) ** 2;
  }

  shorterThan(q, first, second) {
    const { distance, towards, radius } = this;
    const condition = pairDifference(first, second, distance, radius) * (first + second + distance + radius);
    return condition + 4 * distance * radius * Math.cos((q - towards) / 2) ** 2;
  }

  across(q, angle, length, side) {
    const condition = length - this.radius - side * cross(along(angle), this.middle);
    return condition + 2 * this.radius * Math.sin((q - angle) / 2 + (side * Math.PI) / 4) ** 2;
  }
}

/** `middle - q e^{i angle}`: from the pin of a slider to a fixed point. */
class Straight extends Vector {
  constructor(middle, angle) {
    super(middle);
    Object.assign(this, { angle, foot: turned(middle, -angle) });
  }

  at(q) {
    return less(this.middle, times(along(this.angle), q));
  }

  direction(q) {
    return this.angle + Math.atan2(this.foot[1], this.foot[0] - q);
  }

  longerThan(q, first, second) {
    const beside = Math.abs(this.foot[1]),
      length = Math.abs(first - second);
    return (beside - length) * (beside + length) + (this.foot[0] - q) ** 2;
  }

  shorterThan(q, first, second) {
    const from = this.foot[0] - q,
      beside = Math.abs(this.foot[1]),
      square = (first + second - beside) * (first + second + beside);
    if (square < 0) return square - from ** 2;
    return (Math.sqrt(square) - from) * (Math.sqrt(square) + from);
  }

  across(q, angle, length, side) {
    return length - side * (cross(along(angle), this.middle) - q * Math.sin(this.angle - angle));
  }
}

/**
 * The triangle of the pin Z of the drive, the other guide's pivot C and its body point X, with a `varying` and a
 * `still` side at Z: {atZ, atX}, the angle at Z and the acute angle at X, of `shorter` and `longer` as in `Round`, free
 * of cancellation; null if the loop does not close.
 */
function triangle(varying, constant, radius, shorter, longer, pinMovesOnBody) {
  if (!(shorter >= 0 && longer >= 0)) return null;
  const total = varying + constant + radius,
    outer = varying + radius - constant,
    inner = varying + constant - radius,
    larger = Math.max(outer, inner),
    smaller = longer / (larger || 1),
    beyond = shorter / total,
    [lessStill, lessRadius] = outer > inner ? [larger, smaller] : [smaller, larger],
    [ahead, behind] = pinMovesOnBody ? [lessStill, beyond] : [beyond, lessStill],
    [first, second] = [total * ahead, behind * lessRadius];
  return {
    atZ: 2 * Math.atan2(Math.sqrt(ahead * behind), Math.sqrt(total * lessRadius)),
    atX: 2 * Math.atan2(Math.sqrt(Math.min(first, second)), Math.sqrt(Math.max(first, second))),
  };
}

/** The guides of a solution in the linkage's own frames, in which the lengths of a four-bar are as they were given. */
function guidesOf({ links, guides }) {
  const bar = (radius, x, bodyX) => ({ guide: "circle", pivot: [x, 0], radius, body_point: [bodyX, 0] }),
    guideList = links ? [bar(links.crank, 0, 0), bar(links.rocker, links.ground, links.coupler)] : guides;
  return guideList.map((guide) => {
    const angle = (guide.direction ?? guide.body_direction ?? 0) * RAD;
    return { ...guide, fixed: guide[FIXED[guide.guide]], body: guide.body_point, angle };
  });
}

/** The linkage of a solution in the service's reply. */
export class Linkage {
  #pin;
  #spread;
  #arm;
  #shift = 0;

  constructor(solution) {
    const { links = null, mount = null, driver = "crank", branch } = solution,
      { radius, angle } = mount?.coupler_point_polar ?? { radius: 0, angle: 0 };
    this.guides = guidesOf(solution);
    Object.assign(this, { driver, branch, links, turns: driveTurns(solution), mount: links ? mount : true });
    this.origin = mount?.pivot_a ?? [0, 0];
    this.turn = (mount?.ground_angle ?? 0) * RAD;
    this.offset = links ? (solution.body_offset ?? 0) * RAD : 0;
    this.point = times(along(angle * RAD), radius);
    this.start = (links ? solution.start_angle : solution.start) * (this.turns ? RAD : 1);
    const [driven, second] = this.guides,
      arm = less(second.body, driven.body),
      slides = (middle) => new Straight(middle, driven.angle);
    const fromPin = (middle) =>
      driven.guide === "circle"
        ? new Round(middle, driven.radius)
        : driven.guide === "rail"
          ? slides(middle)
          : new Vector(middle);
    this.#pin = fromPin(times(driven.fixed, -1));
    this.#spread = fromPin(less(second.fixed, driven.fixed));
    this.#arm = driven.guide === "slot" ? slides(arm) : new Vector(arm);
    const lengths = this.guides.map(({ used, radius: length }) => (used ? used[1] - used[0] : (length ?? 0)));
    this.reach = Math.max(...lengths, size(arm));
    if (links) {
      const first = this.pose(this.start)?.rotation ?? 0;
      this.#shift = TURN * Math.round((first - Math.atan2(Math.sin(first), Math.cos(first))) / TURN);
    }
  }

  /** True if the drive can turn fully. */
  get turnsFully() {
    const { crank, coupler, rocker, ground } = this.links ?? {};
    if (crank) return FULL_CRANK.includes(family([crank, coupler, rocker, ground]));
    // a loop opens first where one of its vectors is longest or shortest, or reaches farthest across the other guide
    const across = [this.#spread.towards, this.guides[1].angle];
    return this.turns && [0, 1, 2, 3].every((k) => across.every((from) => this.pose(from + (k * Math.PI) / 2)));
  }

  /** {rotation, place, transmission} of the body's frame in that of the guides; null if the loop does not close. */
  pose(q) {
    return this.driver === "hinge" ? this.#byHinge(q) : this.#byPin(q);
  }

  #byPin(q) {
    const [driven, second] = this.guides,
      spread = this.#spread,
      arm = this.#arm,
      onBody = driven.guide === "slot",
      side = this.branch;
    const distance = size(spread.at(q)),
      length = size(arm.at(q)),
      [varying, constant] = onBody ? [arm, spread] : [spread, arm];
    let rotation, transmission;
    if (!(distance > 0)) return null; // any direction would do
    if (second.guide === "circle") {
      const lengths = [constant.distance, second.radius],
        excess = [varying.shorterThan(q, ...lengths), varying.longerThan(q, ...lengths)],
        found = triangle(onBody ? length : distance, ...lengths, ...excess, onBody);
      if (!found) return null;
      rotation = spread.direction(q) + side * found.atZ - arm.direction(q);
      transmission = found.atX;
    } else {
      const isRail = second.guide === "rail",
        projected = isRail ? spread : arm;
      const conditions =
        projected === varying
          ? [1, -1].map((sign) => varying.across(q, second.angle, constant.distance, sign))
          : [varying.longerThan(q, Math.abs(cross(along(second.angle), constant.middle)), 0)];
      if (!conditions.every((value) => value >= 0)) return null;
      const root = conditions.reduce((product, value) => product * Math.sqrt(value), 1),
        beside = cross(along(second.angle), projected.at(q));
      const push = Math.atan2(beside, root),
        angle = side > 0 ? push : Math.PI - push;
      rotation = isRail ? second.angle + angle - arm.direction(q) : spread.direction(q) - angle - second.angle;
      transmission = Math.atan2(root, Math.abs(beside));
    }
    const bodyPoint = onBody ? add(driven.body, times(along(driven.angle), q)) : driven.body;
    return { rotation, place: times(add(this.#pin.at(q), turned(bodyPoint, rotation)), -1), transmission };
  }

  #byHinge(q) {
    const [driven, second] = this.guides,
      rotation = q - driven.angle;
    const between = less(driven.fixed, second.fixed),
      arm = turned(this.#arm.middle, -driven.angle),
      free = add(turned(between, -q), arm);
    let extension, sine, cosine;
    if (second.guide === "circle") {
      const towards = direction(between),
        pushed = new Round(turned([0, arm[1]], towards), size(between)),
        conditions = [1, -1].map((sign) => pushed.across(q, towards, second.radius, sign));
      if (!conditions.every((value) => value >= 0)) return null;
      [sine, cosine] = [Math.sqrt(conditions[0]) * Math.sqrt(conditions[1]), free[1]];
      extension = free[0] - this.branch * sine;
    } else {
      const isRail = second.guide === "rail",
        tilt = isRail ? second.angle - q : second.angle - driven.angle;
      [sine, cosine] = [-Math.sin(tilt), Math.cos(tilt)];
      if (!sine || (isRail && Math.sign(sine) !== this.branch)) return null;
      extension = cross(along(tilt), free) / sine;
    }
    const bodyPoint = add(driven.body, times(along(driven.angle), extension));
    return {
      rotation,
      place: less(driven.fixed, turned(bodyPoint, rotation)),
      transmission: Math.atan2(Math.abs(sine), Math.abs(cosine)),
    };
  }

  /**
   * The joints after the drive has moved by `travel` from the first sample; null if the loop does not close. A, D and
   * C, B lie on the guides, P is the body point; `frames` are {at, angle} of links by name, `coupler` is the body's
   * rotation.
   */
  at(travel) {
    const q = this.start + (this.turns ? travel : travel / RAD),
      pose = this.pose(q);
    if (!pose) return null;
    const { rotation, place, transmission } = pose,
      coupler = rotation - this.#shift + this.turn,
      ground = (point) => add(this.origin, turned(point, this.turn)),
      body = (point) => add(ground(place), turned(point, coupler)),
      [driven] = this.guides,
      parts = { rails: [], slots: [], blocks: [] };
    const ends = this.guides.map((guide) => this.#ends(guide, ground, body, coupler, parts)),
      [[a, d], [b, c]] = ends,
      links = ends.map((pair, k) => (this.guides[k].guide === "circle" ? pair : null)),
      [crank, rocker] = links.map((pair) => pair && { at: pair[0], angle: direction(less(pair[1], pair[0])) });
    const frames = {
      ground: { at: ground(driven.fixed), angle: 0 },
      crank: crank ?? rocker,
      coupler: { at: body(driven.body), angle: coupler },
      rocker,
    };
    const fixed = this.guides.map(({ guide }) => guide !== "rail"),
      [p, line] = [this.mount ? body(this.point) : null, links.every(Boolean) ? [a, b] : null],
      turn = { rotation: coupler + this.offset, coupler, transmission };
    return { travel, a, b, c, d, p, ...turn, ...parts, links, ground: line, fixed, frames };
  }

  /** The two joints of a guide: a fixed pivot and its pin, or the ends of a rail or slot, added to the parts. */
  #ends({ guide, fixed, body: bodyPoint, angle, used }, ground, body, coupler, { rails, slots, blocks }) {
    const at = ground(fixed),
      pin = body(bodyPoint),
      isRail = guide === "rail";
    if (guide === "circle") return [at, pin];
    const [low, high] = used ?? [0, 0],
      margin = BEYOND * this.reach,
      axis = along(angle + (isRail ? this.turn : coupler)),
      line = [low - margin, high + margin].map((s) => add(isRail ? at : pin, times(axis, s)));
    (isRail ? rails : slots).push(line);
    blocks.push([isRail ? pin : at, direction(axis)]);
    return isRail ? [line[1], pin] : [at, line[1]];
  }

  /** Joints at steps + 1 even travels from `first` to `last`; nulls where the loop does not close. */
  over(first, last, steps = 180) {
    return Array.from({ length: steps + 1 }, (_, k) => this.at(first + ((last - first) * k) / steps));
  }
}
