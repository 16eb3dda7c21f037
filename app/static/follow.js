// The linkage that follows a motion: refined from the one before by damped Gauss-Newton steps, from which free drive
// positions are eliminated.

import { Bounds, INSIDE } from "./bounds.js";
import { measured } from "./hand.js";
import { Misfit, STEP } from "./misfit.js";
import { drivePlaces } from "./timing.js";

/** Options of the two descents; lengths are fractions of the motion's size, angles are in radians. */
const OPTIONS = {
  pull: 1e-5, // weight of the squared distance from the reference beside the mean squared error, in the first descent
  steps: 40, // of a descent
  gain: 0.05, // the second descent ends with the first step that lowers the squared error by less than this fraction
  settled: 1e-9, // the first one with the first that lowers what it minimises by less
  rounding: 1e-30, // squared error that is none
  damping: 1e-5, // least damping of a step
  exact: 1e-11, // the same of the second descent where so few samples can be met exactly
  penalty: 1e4, // weight of a squared violation of a limit beside the mean squared error
  near: 0.3, // limits with larger margins are not looked at
  gap: 1e-4, // least distance of the drive between successive samples
  foot: 1e-7, // of the error of a sample: a smaller gain ends that
  feet: 8, // steps to the drive position at which a sample is met best
  checks: 36, // drive positions between the samples at which the loop must close
  better: 0.6, // squared error, as a fraction, of a descent that takes the place of another
  around: 0.7, // angle around a drive position within which a sample is looked for after a change by hand
  beyond: 0.4, // the same of a drive that does not turn, as a fraction of its travel
  tries: 40, // positions that are compared on each side
};

const squares = (values) => values.reduce((sum, value) => sum + value ** 2, 0);
const product = (a, b) => a.reduce((sum, value, k) => sum + value * b[k], 0);

/** Solves a symmetric positive definite system by Cholesky's method; null if it is not definite. */
function solved(matrix, right) {
  const n = right.length,
    lower = matrix.map((row) => [...row]),
    found = [...right];
  for (let i = 0; i < n; i++) {
    for (let j = 0; j <= i; j++) {
      let sum = lower[i][j];
      for (let k = 0; k < j; k++) sum -= lower[i][k] * lower[j][k];
      if (i === j && !(sum > 0)) return null;
      lower[i][j] = i === j ? Math.sqrt(sum) : sum / lower[j][j];
    }
  }
  for (let i = 0; i < n; i++) {
    for (let k = 0; k < i; k++) found[i] -= lower[i][k] * found[k];
    found[i] /= lower[i][i];
  }
  for (let i = n - 1; i >= 0; i--) {
    for (let k = i + 1; k < n; k++) found[i] -= lower[k][i] * found[k];
    found[i] /= lower[i][i];
  }
  return found;
}

/** A descent's linkage: its numbers, drive positions and errors at the samples, its margins, and what is minimised. */
class Following {
  constructor(motion, solution) {
    this.misfit = new Misfit(motion, solution);
    this.ordered = !motion.anyOrder;
  }

  /** Begins at a linkage: limits that the reference satisfies for its own motion are kept. */
  begin(solution, { solution: before, motion }) {
    const { misfit } = this,
      numbers = misfit.numbersOf(before),
      model = misfit.made(numbers),
      own = misfit.free ? misfit.driveOf(before) : misfit.driveAt(numbers),
      { spots, closes } = this.#between(model, own),
      reference = { made: model, before: motion, spots, family: before.family };
    Object.assign(this, { reference: numbers, closes, sense: own.at(-1) < own[0] ? -1 : 1 });
    this.bounds = new Bounds(misfit.motion, misfit.scale, reference);
    return this.#measured(misfit.numbersOf(solution), misfit.free ? misfit.driveOf(solution) : null);
  }

  /**
   * The drive's positions from the start of a solution, in its units, at which it meets the samples best: looked for
   * around the former ones. Null where the loop is open at one of them.
   */
  passing(solution) {
    const { misfit } = this,
      model = misfit.made(misfit.numbersOf(solution)),
      former = misfit.driveOf(solution),
      [first, last] = [former[0], former.at(-1)],
      around = misfit.turns ? OPTIONS.around : OPTIONS.beyond * Math.max(...former.map((q) => Math.abs(q - first))),
      steps = Array.from({ length: 2 * OPTIONS.tries + 1 }, (_, n) => (around * (n - OPTIONS.tries)) / OPTIONS.tries);
    this.sense = last < first ? -1 : 1;
    const begins = former.map((q, k) => {
      const costs = steps.map((step) => this.#cost(model, k, q + step));
      return q + steps[costs.indexOf(Math.min(...costs))];
    });
    const blocks = this.#blocks(model, begins);
    return blocks && blocks.flatMap((block) => block.q).map((q) => (q - first) / misfit.unit);
  }

  #cost({ at }, k, q) {
    const joints = at(q);
    return joints ? squares(this.misfit.error(k, joints)) : Infinity;
  }

  /** The ends of the drive's interval, and where the transmission angle is least; whether the loop stays closed. */
  #between({ at }, drive) {
    const low = Math.min(...drive),
      high = Math.max(...drive),
      { checks } = OPTIONS,
      step = (high - low) / checks,
      angles = Array.from({ length: checks + 1 }, (_, k) => at(low + k * step)?.transmission ?? -1),
      isValley = (k) => k > 0 && k < checks && angles[k] <= angles[k - 1] && angles[k] < angles[k + 1],
      valleys = [...angles.keys()].filter(isValley).sort((i, j) => angles[i] - angles[j]);
    // the vertex of the parabola through three of them
    const bottom = (k) => {
      if (k === undefined) return low;
      const [before, middle, after] = angles.slice(k - 1, k + 2);
      return low + step * (k + (before - after) / 2 / (before - 2 * middle + after));
    };
    const spots = [low, high, bottom(valleys[0]), bottom(valleys[1] ?? valleys[0])];
    return { spots, closes: angles.every((angle) => angle >= 0) };
  }

  /** A block of samples that are passed together: the drive position `z` at which they are met best, near `z`. */
  #foot(model, members, z) {
    const { misfit, sense } = this,
      gap = this.ordered && members.length > 1 ? OPTIONS.gap * misfit.unitOfDrive : 0;
    const look = (from) => {
      const q = members.map((_, n) => from + sense * gap * (n - (members.length - 1) / 2)),
        joints = q.map(model.at);
      if (!joints.every(Boolean)) return { cost: Infinity };
      const errors = joints.flatMap((jointSet, n) => misfit.error(members[n], jointSet));
      return { z: from, q, errors, cost: squares(errors) };
    };
    let best = look(z);
    if (best.cost === Infinity) return best;
    for (let n = 0; n < OPTIONS.feet; n++) {
      const slopes = members.flatMap((k, i) => misfit.slopeOfDrive(k, model, best.q[i])),
        along = product(slopes, best.errors),
        steep = squares(slopes);
      let step = steep > 0 ? -along / steep : 0,
        next = null;
      for (let half = 0; half < 8 && Math.abs(step) > 1e-13 * misfit.unitOfDrive; half++, step /= 2) {
        next = look(best.z + step);
        if (next.cost < best.cost) break;
        next = null;
      }
      if (!next) return best;
      const gained = best.cost - next.cost;
      best = next;
      if (gained <= OPTIONS.foot * best.cost) return best;
    }
    return best;
  }

  /** Blocks of samples with the drive positions at which they are met best; those out of order are pooled. */
  #blocks(model, drive) {
    const blocks = [],
      gap = OPTIONS.gap * this.misfit.unitOfDrive,
      isLate = (block) => this.sense * (block.q[0] - blocks.at(-1).q.at(-1)) < gap;
    for (const [k, q] of drive.entries()) {
      let block = { members: [k], ...this.#foot(model, [k], q) };
      while (this.ordered && blocks.length && block.cost < Infinity && isLate(block)) {
        const before = blocks.pop(),
          members = [...before.members, ...block.members],
          sum = before.z * before.members.length + block.z * block.members.length;
        block = { members, ...this.#foot(model, members, sum / members.length) };
      }
      if (block.cost === Infinity) return null;
      blocks.push(block);
    }
    return blocks;
  }

  /** The samples at the given positions of the drive, each a block; null if a loop is open. */
  #given(model, drive) {
    const joints = drive.map(model.at);
    if (!joints.every(Boolean)) return null;
    const turns = this.misfit.wholeTurns(joints);
    return joints.map((jointSet, k) => ({
      members: [k],
      q: [drive[k]],
      errors: this.misfit.error(k, jointSet, turns),
    }));
  }

  /** A linkage of these numbers with its errors, near positions `drive` if they are free; null if it does not close. */
  #measured(numbers, drive) {
    const { misfit } = this,
      model = misfit.made(numbers),
      blocks = model && (misfit.free ? this.#blocks(model, drive) : this.#given(model, misfit.driveAt(numbers)));
    if (!blocks) return null;
    const q = blocks.flatMap((block) => block.q),
      { spots, closes } = this.#between(model, q);
    if (this.closes && !closes) return null;
    const cost = squares(blocks.flatMap(({ errors }) => errors)) / q.length,
      margins = this.bounds.margins(model, spots),
      penalty = OPTIONS.penalty * squares(margins.map((margin) => Math.min(0, margin - INSIDE)));
    return { numbers, made: model, blocks, drive: q, spots, cost, margins, penalty };
  }

  /** The normal equations of the mean squared error: matrix and half its slope, free drive positions eliminated. */
  #normal({ made: model, blocks, drive }, beside) {
    const { misfit } = this,
      n = misfit.units.length,
      matrix = Array.from({ length: n }, () => new Array(n).fill(0)),
      slope = new Array(n).fill(0),
      shares = [];
    for (const { members, errors, q } of blocks) {
      const all = members.map((k, i) => misfit.slopes(k, model, beside, q[i])),
        drives = members.flatMap((k, i) => (misfit.free ? misfit.slopeOfDrive(k, model, q[i]) : [0, 0, 0])),
        steep = squares(drives),
        columns = slope.map((_, j) => all.flatMap((slopes) => slopes[j])),
        ratios = columns.map((column) => (steep > 0 ? product(column, drives) / steep : 0));
      for (const [j, column] of columns.entries()) for (const i of column.keys()) column[i] -= ratios[j] * drives[i];
      shares.push(...members.map(() => ratios));
      for (let i = 0; i < n; i++) {
        slope[i] += product(columns[i], errors) / drive.length;
        for (let j = 0; j <= i; j++) matrix[i][j] += product(columns[i], columns[j]) / drive.length;
      }
    }
    for (let i = 0; i < n; i++) for (let j = 0; j < i; j++) matrix[j][i] = matrix[i][j];
    return { matrix, slope, shares };
  }

  /** Return the derivatives of the drive positions in `spots` by number j, from those at the ends of the interval. */
  #drift({ drive, spots }, shares, j) {
    const { free, unitOfDrive, units } = this.misfit,
      [low, high] = spots,
      [first, last] = [low, high].map((q) => shares[drive.indexOf(q)][j]);
    if (!free) return spots.map(() => (j === units.length - 1 ? unitOfDrive : 0));
    return spots.map((q) => ((q - high) * first + (low - q) * last) / (high - low || 1));
  }

  /** Slopes of the limits that are near, by differences: rows {margin, slope}. */
  #limits(state, shares, beside) {
    const { numbers, made: model, margins, spots } = state,
      near = [...margins.keys()].filter((k) => margins[k] < OPTIONS.near),
      rows = near.map((k) => ({ k, margin: margins[k] - INSIDE, slope: [] }));
    for (const j of near.length ? numbers.keys() : []) {
      const moved = j < beside.length ? beside[j][0] : model,
        drift = this.#drift(state, shares, j),
        positions = spots.map((q, k) => q + STEP * drift[k]),
        after = moved && this.bounds.margins(moved, positions),
        isComparable = after?.length === margins.length;
      for (const { k, slope } of rows) slope.push(isComparable ? (after[k] - margins[k]) / STEP : 0);
    }
    return rows;
  }

  /** The step of least squares with limits that it would violate as further errors. */
  #step({ matrix, slope }, limits, damping) {
    const active = new Set(limits.filter(({ margin }) => margin < 0));
    for (let n = 0; ; n++) {
      const left = matrix.map((row, i) => row.with(i, row[i] + damping)),
        right = slope.map((value) => -value);
      for (const { margin, slope: row } of active)
        for (const [i, value] of row.entries()) {
          right[i] -= OPTIONS.penalty * margin * value;
          for (const [j, entry] of row.entries()) left[i][j] += OPTIONS.penalty * value * entry;
        }
      const step = solved(left, right),
        isBroken = (limit) => !active.has(limit) && limit.margin + product(limit.slope, step) < 0,
        more = step ? limits.filter(isBroken) : [];
      if (!more.length || n === 5) return step;
      for (const limit of more) active.add(limit);
    }
  }

  /**
   * Descends from `state`, which it yields after each step; `pull` draws towards the reference, and a step that gains
   * less than the fraction `gain` is the last.
   */
  *descend(state, pull, gain) {
    const away = ({ numbers }) => squares(numbers.map((value, j) => value - this.reference[j]));
    const total = (candidate) => candidate.cost + candidate.penalty + pull * away(candidate);
    const minDamping = pull || !this.misfit.exact ? OPTIONS.damping : OPTIONS.exact;
    let damping = minDamping;
    for (let n = 0; n < OPTIONS.steps && state.cost + state.penalty > OPTIONS.rounding; n++) {
      const beside = this.misfit.beside(state.numbers),
        { matrix, slope, shares } = this.#normal(state, beside),
        limits = this.#limits(state, shares, beside),
        before = total(state),
        { numbers, drive } = state;
      const normal = {
        slope: slope.map((value, j) => value + pull * (numbers[j] - this.reference[j])),
        matrix: matrix.map((row, j) => row.with(j, row[j] + pull)),
      };
      let next = null;
      for (; damping < 1e3 && !next; damping *= next ? 1 : 10) {
        const step = this.#step(normal, limits, damping),
          moved = step?.map((value, j) => numbers[j] + value),
          positions = step && drive.map((q, k) => q - product(shares[k], step));
        next = step && this.#measured(moved, positions);
        if (next && !(total(next) < before)) next = null;
      }
      if (!next) return state;
      state = next;
      yield state;
      damping = Math.max(minDamping, damping / 10);
      if (before - total(state) < gain * before) return state;
    }
    return state;
  }
}

/**
 * Leads `solution` to a linkage of its kind, branch and family that meets a motion, step by step: yields functions that
 * make the solution reached. `reference` is {solution, motion}: the linkage moves from that one no farther than the
 * motion needs, and keeps the limits that it satisfies. A descent from the reference itself takes the place of this one
 * where it ends much nearer to the motion.
 */
export function* followed(motion, solution, reference) {
  const following = new Following(motion, solution),
    total = (state) => (state ? state.cost + state.penalty : Infinity),
    solutionOf =
      ({ numbers, drive }) =>
      () =>
        following.misfit.solution(numbers, drive, solution);
  const descents = function* (begin) {
    const first = following.begin(begin, reference);
    if (!first) return null;
    const near = yield* following.descend(first, OPTIONS.pull, OPTIONS.settled);
    return yield* following.descend(near, 0, OPTIONS.gain);
  };
  let found = null;
  for (const begin of new Set([solution, reference.solution])) {
    const run = descents(begin);
    let step = run.next();
    for (; !step.done; step = run.next()) yield solutionOf(found ?? step.value);
    if (total(step.value) < OPTIONS.better * total(found)) found = step.value;
  }
  if (found) yield solutionOf(found);
}

/** A solution changed by hand with its errors; free crank angles are found anew, the start is `shift` further on. */
export function assessed(solution, motion) {
  const angles = motion.timing === "free" && drivePlaces(solution) && new Following(motion, solution).passing(solution);
  if (!angles) return { shift: 0, ...measured(solution, motion) };
  const own = solution.crank_angle ? "crank_angle" : "travel",
    begin = solution.links ? "start_angle" : "start",
    [shift] = angles,
    moved = { [begin]: solution[begin] + shift, [own]: angles.map((angle) => angle - shift) };
  return { shift, ...measured({ ...solution, ...moved }, motion) };
}
