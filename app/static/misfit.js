// A motion and a kind of linkage as a least squares problem: the numbers of a linkage, its errors at the samples, and
// their slopes.

import { UNKNOWN, fromJoints } from "./hand.js";
import { FIXED, Linkage } from "./kinematics.js";
import { placeOf, placesOf, travels, wantsAngles, wantsPlaces } from "./motion.js";
import { RAD, add, along, less, size, times, turned } from "./plane.js";
import { drivePlaces, driveTurns } from "./timing.js";

const NUMBERS = 5; // of a guide: its fixed point, its radius or direction, its point on the body
const ANGLE = { rail: "direction", slot: "body_direction" };
const TURN = 2 * Math.PI;

/** Step of the differences that stand for slopes, in units of the numbers. */
export const STEP = 1e-6;

/** The guides of a solution in the frames of the ground and of the body at its point, and the start of the drive. */
function guidesOf(solution) {
  if (!solution.links) return solution;
  const { links, mount, branch, start_angle, body_offset } = solution,
    turn = (mount?.ground_angle ?? 0) * RAD,
    pivot = mount?.pivot_a ?? [0, 0],
    secondPivot = mount?.pivot_b ?? add(pivot, times(along(turn), links.ground)),
    { radius, angle } = mount?.coupler_point_polar ?? { radius: 0, angle: 0 },
    point = times(along(angle * RAD), radius),
    local = (joint) => turned(less(joint, point), -(body_offset ?? 0) * RAD);
  const guides = [
    { guide: "circle", pivot, radius: links.crank, body_point: local([0, 0]) },
    { guide: "circle", pivot: secondPivot, radius: links.rocker, body_point: local([links.coupler, 0]) },
  ];
  return { guides, driver: "crank", branch, start: start_angle + turn / RAD };
}

export class Misfit {
  constructor(motion, solution) {
    const { guides, driver, branch } = guidesOf(solution),
      positions = placesOf(motion),
      kinds = guides.map(({ guide }) => guide),
      middle = [0, 1].map((i) => positions.reduce((sum, point) => sum + point[i], 0) / (positions.length || 1)),
      reach = Math.max(
        ...guides.map(({ radius = 0, body_point }) => Math.max(radius, size(body_point))),
        Number.MIN_VALUE,
      );
    Object.assign(this, { motion, driver, branch, middle, kinds });
    this.free = motion.timing === "free";
    this.turns = driveTurns(solution);
    this.scale = Math.max(0, ...positions.map((point) => size(less(point, middle)))) || reach;
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
    const rows = this.samples.map(({ place, angle }) => (place ? 2 : 0) + (angle === null ? 0 : 1) - 1);
    this.exact = this.free && rows.reduce((sum, count) => sum + count, 0) < 2 * NUMBERS - 1;
    // of each number: the length or angle that stands for one
    const long = this.scale;
    this.units = kinds.flatMap((kind) => [long, long, kind === "circle" ? long : 1, long, long]);
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
    return drivePlaces(solution).map((position) => (guidesOf(solution).start + position) * this.unit);
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
    const { place, angle, weights } = this.samples[k],
      off = place ? times(less(got, place), weights[0]) : [0, 0],
      gap = rotation - angle,
      turns = this.free ? TURN * Math.round(gap / TURN) : counted;
    return [...off, angle === null ? 0 : weights[1] * (gap - turns)];
  }

  /** The whole turns by which the body is mounted away from what is wanted where crank angles are given. */
  wholeTurns(joints) {
    const gaps = this.samples.flatMap(({ angle }, k) => (angle === null ? [] : [joints[k].rotation - angle]));
    return gaps.length ? TURN * Math.round(gaps.reduce((sum, gap) => sum + gap, 0) / gaps.length / TURN) : 0;
  }

  /** Linkages of which one number is a step greater or less: a pair for each number of the guides. */
  beside(numbers) {
    const guided = numbers.slice(0, NUMBERS * this.kinds.length);
    return guided.map((value, j) => [STEP, -STEP].map((step) => this.made(numbers.with(j, value + step))));
  }

  /** The slope of the error of sample k by the coordinate of the drive at q. */
  slopeOfDrive(k, { at }, q) {
    const step = STEP * this.unitOfDrive;
    return this.#difference(k, at(q + step), at(q - step), step);
  }

  /** The slopes of that error by each number, with the linkages `beside` it. */
  slopes(k, model, beside, q) {
    const found = beside.map(([more, fewer]) => this.#difference(k, more?.at(q), fewer?.at(q), STEP));
    return this.free ? found : [...found, this.slopeOfDrive(k, model, q).map((slope) => slope * this.unitOfDrive)];
  }

  #difference(k, forward, backward, step) {
    const before = backward ? this.error(k, backward) : null;
    return forward && before ? this.error(k, forward).map((value, i) => (value - before[i]) / (2 * step)) : [0, 0, 0];
  }

  /**
   * The solution with these numbers and drive positions, of the kind of the solution `before`, without what the service
   * said of that.
   */
  solution(numbers, drive, before) {
    const model = this.made(numbers),
      start = drive[0] / this.unit,
      own = { ...UNKNOWN, source: "moved" },
      name = before.travel ? "travel" : "crank_angle";
    if (this.free) own[name] = drive.map((q) => q / this.unit - start);
    if (!before.links) return { ...before, ...own, guides: model.guides, start };
    const joints = model.linkage.at(this.turns ? drive[0] : drive[0] * RAD),
      turns = this.free ? 0 : this.wholeTurns(drive.map(model.at)),
      found = fromJoints({ ...joints, rotation: joints.rotation - turns }, 0, before),
      { mount, links } = found;
    if (found.body_offset !== null) {
      if (!before.mount) found.body_offset += mount.ground_angle;
      if (this.free) found.body_offset += 360 * Math.round((before.body_offset - found.body_offset) / 360);
    }
    if (before.mount) return { ...found, ...own };
    const relative = Object.entries(links).map(([side, length]) => [side, length / links.ground]);
    return { ...found, ...own, mount: null, links: Object.fromEntries(relative) };
  }
}
