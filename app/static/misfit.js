// A motion and a kind of linkage as a least squares problem: the numbers of a linkage, its errors at the samples, and
// their derivatives.

import { drivePlaces, driveTurns } from "./drive.js";
import { fromJoints } from "./hand.js";
import { Linkage } from "./kinematics.js";
import { placeOf, placesOf, travels, wantsAngles, wantsPlaces } from "./motion.js";
import { RAD, add, along, dot, less, size, times, turned } from "./plane.js";

const NUMBERS = 5; // of a guide: its fixed point, its radius or direction, its point on the body
const FIXED = { circle: "pivot", rail: "point", slot: "pin" };
const ANGLE = { rail: "direction", slot: "body_direction" };
const TURN = 2 * Math.PI;
/** What the service said of a solution and does not say of one that was moved from it. */
const BARE = Object.fromEntries(
  [
    "rank",
    "verdict",
    "rounded",
    "analysis",
    "tolerance_study",
    "excursion",
    "transmission_angle_min_turn",
    "arm_min",
    "sensitivity",
    "condition",
    "determination",
    "has_smallest_error",
  ].map((name) => [name, null]),
);

const perpendicular = ([x, y]) => [-y, x];
const dot3 = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** The inverse of a matrix of three rows, as rows. */
function inverted([a, b, c]) {
  const crossed = ([x, y, z], [u, v, w]) => [y * w - z * v, z * u - x * w, x * v - y * u];
  const columns = [crossed(b, c), crossed(c, a), crossed(a, b)],
    determinant = dot3(a, columns[0]);
  return [0, 1, 2].map((i) => columns.map((column) => column[i] / determinant));
}

/**
 * The guides of a solution in the frames of the ground and of the body at its point, and the drive at the first sample.
 */
export function guidesOf(solution) {
  if (!solution.links) return solution;
  const { links, mount, branch, start_angle } = solution,
    offset = (solution.body_offset ?? 0) * RAD,
    turn = (mount?.ground_angle ?? 0) * RAD;
  const pivot = mount?.pivot_a ?? [0, 0],
    other = mount?.pivot_b ?? add(pivot, times(along(turn), links.ground));
  const point = mount?.coupler_point_polar
    ? times(along(mount.coupler_point_polar.angle * RAD), mount.coupler_point_polar.radius)
    : [0, 0];
  const circle = (fixed, radius, held) => ({
    guide: "circle",
    pivot: fixed,
    radius,
    body_point: turned(less(held, point), -offset),
  });
  return {
    guides: [circle(pivot, links.crank, [0, 0]), circle(other, links.rocker, [links.coupler, 0])],
    driver: "crank",
    branch,
    start: start_angle + turn / RAD,
  };
}

/**
 * Rows of the loop's equations at a closed position: each by the body's x, y, angle, by the five numbers of a guide,
 * and by the drive.
 */
function equations({ place: p, rotation }, guides, driver, q) {
  const cosine = Math.cos(rotation),
    sine = Math.sin(rotation);
  const parts = guides.map(({ guide, pivot, pin, point, radius, direction, body_direction, body_point: [u, v] }) => {
    const held = [cosine * u - sine * v, sine * u + cosine * v],
      [x, y] = pivot ?? pin ?? point,
      beyond = [p[0] + held[0] - x, p[1] + held[1] - y];
    return {
      guide,
      held,
      beyond,
      axis:
        guide === "circle"
          ? times(beyond, 1 / radius)
          : along(guide === "rail" ? direction * RAD : body_direction * RAD + rotation),
    };
  });
  // the distance in a direction that turns by `own` with its guide's angle and by `carried` with the body
  const distance = ([x, y], { held: [u, v] }, own, carried, drive) => [
    x,
    y,
    y * u - x * v + carried,
    -x,
    -y,
    own,
    cosine * x + sine * y,
    cosine * y - sine * x,
    drive,
  ];
  const lines = parts.map((part) => {
    const { guide, axis, beyond } = part;
    if (guide === "circle") return distance(axis, part, -1, 0, 0);
    const slide = -dot(axis, beyond);
    return distance(perpendicular(axis), part, slide, guide === "slot" ? slide : 0, 0);
  });
  const [driven] = parts,
    { axis, beyond } = driven,
    across = dot(perpendicular(axis), beyond);
  if (driver === "crank") return [...lines, distance(perpendicular(along(q)), driven, 0, 0, -dot(along(q), beyond))];
  if (driver === "slider") return [...lines, distance(axis, driven, across, 0, -1)];
  if (driver === "cylinder") return [...lines, distance(axis, driven, across, across, 1)];
  return [...lines, [0, 0, 1, 0, 0, 1, 0, 0, -1]];
}

export class Misfit {
  constructor(motion, solution) {
    const { guides, driver, branch } = guidesOf(solution),
      places = placesOf(motion);
    const middle = [0, 1].map((i) => places.reduce((sum, place) => sum + place[i], 0) / (places.length || 1));
    const reach = Math.max(
      ...guides.map(({ radius, body_point }) => Math.max(radius ?? 0, size(body_point))),
      Number.MIN_VALUE,
    );
    Object.assign(this, {
      motion,
      driver,
      branch,
      middle,
      kinds: guides.map(({ guide }) => guide),
      free: motion.timing === "free",
      turns: driveTurns(solution),
    });
    this.scale = Math.max(0, ...places.map((place) => size(less(place, middle)))) || reach;
    this.unit = this.turns ? RAD : 1; // of the drive's coordinate in a solution
    this.unitOfDrive = this.turns ? 1 : this.scale;
    this.samples = motion.poses.map((pose) => ({
      place: wantsPlaces(motion) && placeOf(pose),
      angle: wantsAngles(motion) && pose.angle !== null ? pose.angle * RAD : null,
      weights: [Math.sqrt(pose.wp ?? 1) / this.scale, Math.sqrt(pose.wr ?? 1)],
    }));
    this.travels = travels(motion).map((travel) => motion.direction * travel * this.unit);
    // whether linkages meet the samples exactly, a family of them: each sample takes as many numbers as it has errors
    // that no drive position removes
    const rows = this.samples.reduce(
      (sum, { place, angle }) => sum + (place ? 2 : 0) + (angle === null ? 0 : 1) - 1,
      0,
    );
    this.exact = this.free && rows < 2 * NUMBERS - 1;
    // of each number: the length or angle that stands for one
    this.units = this.kinds.flatMap((kind) => [
      this.scale,
      this.scale,
      kind === "circle" ? this.scale : 1,
      this.scale,
      this.scale,
    ]);
    if (!this.free) this.units.push(this.unitOfDrive);
  }

  /** The numbers of a solution: those of its guides, and of its start unless the crank angles are free. */
  numbersOf(solution) {
    const { guides, start } = guidesOf(solution);
    const all = guides.flatMap((guide) => [
      ...less(guide[FIXED[guide.guide]], this.middle),
      guide.radius ?? guide[ANGLE[guide.guide]] * RAD,
      ...guide.body_point,
    ]);
    return [...all, start * this.unit].slice(0, this.units.length).map((value, j) => value / this.units[j]);
  }

  /** The drive's coordinate at the samples: of a solution, or of numbers that hold its start. */
  driveOf(solution) {
    return drivePlaces(solution).map((place) => (guidesOf(solution).start + place) * this.unit);
  }

  driveAt(numbers) {
    return this.travels.map((travel) => numbers.at(-1) * this.units.at(-1) + travel);
  }

  /**
   * {guides, linkage} with these numbers, and `at(q)`, the body where the drive is at q; null where a length would be
   * negative.
   */
  made(numbers) {
    const values = numbers.map((value, j) => value * this.units[j]),
      { driver, branch } = this;
    const guides = this.kinds.map((guide, k) => {
      const [x, y, own, u, v] = values.slice(NUMBERS * k, NUMBERS * (k + 1));
      return {
        guide,
        [FIXED[guide]]: add(this.middle, [x, y]),
        ...(guide === "circle" ? { radius: own } : { [ANGLE[guide]]: own / RAD }),
        body_point: [u, v],
        used: null,
      };
    });
    if (guides.some(({ radius = 1 }) => !(radius > 0))) return null;
    const linkage = new Linkage({ guides, driver, branch, start: 0 });
    return { guides, linkage, at: (q) => linkage.pose(q) };
  }

  /**
   * The weighted error [x, y, angle] of sample k at joints, zero where nothing is wanted; without whole turns unless
   * `counted`.
   */
  error(k, { place: got, rotation }, counted = 0) {
    const {
        place,
        angle,
        weights: [wp, wr],
      } = this.samples[k],
      off = place ? times(less(got, place), wp) : [0, 0],
      gap = angle === null ? 0 : rotation - angle;
    return [...off, wr * (gap - (this.free ? TURN * Math.round(gap / TURN) : angle === null ? 0 : counted))];
  }

  /** The whole turns by which the body is mounted away from what is wanted where crank angles are given. */
  wholeTurns(joints) {
    const gaps = this.samples.flatMap(({ angle }, k) => (angle === null ? [] : [joints[k].rotation - angle]));
    return gaps.length ? TURN * Math.round(gaps.reduce((sum, gap) => sum + gap, 0) / gaps.length / TURN) : 0;
  }

  /** Derivatives of `error` at joints, by the drive's coordinate q and by each number. */
  derivatives(k, joints, guides, q) {
    const rows = equations(joints, guides, this.driver, q),
      inverse = inverted(rows.map((row) => row.slice(0, 3)));
    const {
        place,
        angle,
        weights: [wp, wr],
      } = this.samples[k],
      weights = [place ? wp : 0, place ? wp : 0, angle === null ? 0 : wr];
    const [line, other, drive] = rows,
      columns = [];
    const by = (a, b, c, unit) =>
      [0, 1, 2].map((i) => -weights[i] * unit * (inverse[i][0] * a + inverse[i][1] * b + inverse[i][2] * c));
    for (let j = 0; j < NUMBERS; j++) columns.push(by(line[3 + j], 0, drive[3 + j], this.units[j]));
    for (let j = 0; j < NUMBERS; j++) columns.push(by(0, other[3 + j], 0, this.units[NUMBERS + j]));
    if (!this.free) columns.push(by(0, 0, drive[8], this.unitOfDrive));
    return { drive: by(0, 0, drive[8], 1), numbers: columns };
  }

  /**
   * The solution with these numbers and drive positions, of the kind of the solution `before`, without what the service
   * said of that.
   */
  solution(numbers, drive, before) {
    const made = this.made(numbers),
      start = drive[0] / this.unit,
      own = { ...BARE, source: "moved" };
    const places = this.free
      ? { [before.travel ? "travel" : "crank_angle"]: drive.map((q) => q / this.unit - start) }
      : {};
    if (!before.links) return { ...before, ...own, ...places, guides: made.guides, start };
    const joints = made.linkage.at(this.turns ? drive[0] : drive[0] * RAD),
      whole = this.free ? 0 : this.wholeTurns(drive.map(made.at)),
      { mount, links, body_offset, ...found } = fromJoints({ ...joints, rotation: joints.rotation - whole }, 0, before);
    const offset = body_offset === null ? null : body_offset + (before.mount ? 0 : mount.ground_angle);
    const placed = before.mount
      ? { mount, links }
      : {
          mount: null,
          links: Object.fromEntries(Object.entries(links).map(([name, length]) => [name, length / links.ground])),
        };
    return {
      ...found,
      ...own,
      ...places,
      ...placed,
      body_offset:
        this.free && offset !== null ? offset + 360 * Math.round((before.body_offset - offset) / 360) : offset,
    };
  }
}
