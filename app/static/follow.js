// The linkage that follows a motion: refined from the one before by damped Gauss-Newton steps, from which free drive
// positions are eliminated.

import { Bounds, INSIDE } from "./bounds.js";
import { Misfit } from "./misfit.js";

/** Of the two descents; lengths are fractions of the motion's size, angles are in radians. */
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
  slope: 1e-6, // step of the differences that stand for the slopes of limits
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
  begin(solution, reference) {
    const { misfit } = this,
      numbers = misfit.numbersOf(reference.solution),
      made = misfit.made(numbers);
    const own = misfit.free ? misfit.driveOf(reference.solution) : misfit.driveAt(numbers);
    const { spots, closes } = this.#between(made, own);
    Object.assign(this, {
      reference: numbers,
      closes,
      bounds: new Bounds(misfit.motion, misfit.scale, {
        made,
        before: reference.motion,
        spots,
        family: reference.solution.family,
      }),
    });
    this.sense = own.at(-1) < own[0] ? -1 : 1;
    return this.#measured(misfit.numbersOf(solution), misfit.free ? misfit.driveOf(solution) : null);
  }

  /**
   * The ends of the interval of the drive, and where in it the transmission angle is least; whether the loop closes all
   * along.
   */
  #between({ at }, drive) {
    const low = Math.min(...drive),
      high = Math.max(...drive),
      { checks } = OPTIONS;
    const places = Array.from({ length: checks + 1 }, (_, k) => low + ((high - low) * k) / checks),
      angles = places.map((q) => at(q)?.transmission ?? -1);
    const valleys = [...places.keys()]
      .filter((k) => k > 0 && k < checks && angles[k] <= angles[k - 1] && angles[k] < angles[k + 1])
      .sort((i, j) => angles[i] - angles[j]);
    // the vertex of the parabola through three of them
    const bottom = (k) =>
      k === undefined
        ? low
        : places[k] +
          ((places[1] - low) * (angles[k - 1] - angles[k + 1])) / 2 / (angles[k - 1] - 2 * angles[k] + angles[k + 1]);
    return {
      spots: [low, high, bottom(valleys[0]), bottom(valleys[1] ?? valleys[0])],
      closes: angles.every((angle) => angle >= 0),
    };
  }

  /** A block of samples that are passed together: the drive position `z` at which they are met best, near `z`. */
  #foot(made, members, z) {
    const { misfit, sense } = this,
      gap = this.ordered && members.length > 1 ? OPTIONS.gap * misfit.unitOfDrive : 0;
    const place = (from) => members.map((k, n) => from + sense * gap * (n - (members.length - 1) / 2));
    const look = (from) => {
      const q = place(from),
        joints = q.map(made.at);
      if (!joints.every(Boolean)) return { cost: Infinity };
      const errors = joints.map((one, n) => misfit.error(members[n], one));
      return { z: from, q, joints, errors, cost: errors.reduce((sum, error) => sum + squares(error), 0) };
    };
    let best = look(z);
    if (best.cost === Infinity) return best;
    for (let n = 0; n < OPTIONS.feet; n++) {
      const slopes = best.joints.map((one, i) => misfit.derivatives(members[i], one, made.guides, best.q[i]).drive);
      const along = slopes.reduce((sum, slope, i) => sum + product(slope, best.errors[i]), 0),
        steep = slopes.reduce((sum, slope) => sum + squares(slope), 0);
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
  #blocks(made, drive) {
    const blocks = [];
    for (const [k, q] of drive.entries()) {
      let block = { members: [k], ...this.#foot(made, [k], q) };
      while (
        this.ordered &&
        blocks.length &&
        block.cost < Infinity &&
        this.sense * (block.q[0] - blocks.at(-1).q.at(-1)) < OPTIONS.gap * this.misfit.unitOfDrive
      ) {
        const before = blocks.pop(),
          members = [...before.members, ...block.members],
          middle = (before.z * before.members.length + block.z * block.members.length) / members.length;
        block = { members, ...this.#foot(made, members, middle) };
      }
      if (block.cost === Infinity) return null;
      blocks.push(block);
    }
    return blocks;
  }

  /**
   * A linkage of these numbers with its errors; `drive` is where free drive positions are looked for. Null where it
   * does not close.
   */
  #measured(numbers, drive) {
    const { misfit } = this,
      made = misfit.made(numbers);
    if (!made) return null;
    let blocks;
    if (misfit.free) blocks = this.#blocks(made, drive);
    else {
      const all = misfit.driveAt(numbers),
        joints = all.map(made.at),
        turns = joints.every(Boolean) && misfit.wholeTurns(joints);
      blocks =
        joints.every(Boolean) &&
        joints.map((one, k) => ({ members: [k], q: [all[k]], joints: [one], errors: [misfit.error(k, one, turns)] }));
    }
    if (!blocks) return null;
    const q = blocks.flatMap((block) => block.q),
      { spots, closes } = this.#between(made, q);
    if (this.closes && !closes) return null;
    const cost =
      blocks.reduce((sum, { errors }) => sum + errors.reduce((part, error) => part + squares(error), 0), 0) / q.length;
    const margins = this.bounds.margins(made, spots),
      violation = margins.reduce((sum, margin) => sum + Math.min(0, margin - INSIDE) ** 2, 0);
    return { numbers, made, blocks, drive: q, spots, cost, margins, penalty: OPTIONS.penalty * violation };
  }

  /**
   * The normal equations of the mean squared error: its matrix and half its slope, the free drive positions eliminated.
   */
  #normal({ made, blocks, drive }) {
    const { misfit } = this,
      n = misfit.units.length,
      matrix = Array.from({ length: n }, () => new Array(n).fill(0)),
      slope = new Array(n).fill(0),
      shares = [];
    for (const { members, joints, errors, q } of blocks) {
      const all = members.map((k, i) => misfit.derivatives(k, joints[i], made.guides, q[i]));
      const columns = Array.from({ length: n }, (_, j) => all.flatMap(({ numbers }) => numbers[j])),
        error = errors.flat(),
        drives = all.flatMap((one) => one.drive),
        steep = squares(drives);
      const ratios = columns.map((column) => (misfit.free && steep > 0 ? product(column, drives) / steep : 0));
      columns.forEach((column, j) =>
        column.forEach((_, i) => {
          column[i] -= ratios[j] * drives[i];
        }),
      );
      shares.push(...members.map(() => ratios));
      for (let i = 0; i < n; i++) {
        slope[i] += product(columns[i], error) / drive.length;
        for (let j = 0; j <= i; j++) matrix[i][j] += product(columns[i], columns[j]) / drive.length;
      }
    }
    for (let i = 0; i < n; i++) for (let j = 0; j < i; j++) matrix[j][i] = matrix[i][j];
    return { matrix, slope, shares };
  }

  /** How far drive positions between the samples move with number j, as those at the ends of the interval do. */
  #drift({ drive, spots }, shares, j) {
    const { free, unitOfDrive, units } = this.misfit,
      [low, high] = spots,
      [first, last] = [low, high].map((q) => shares[drive.indexOf(q)][j]);
    return spots.map((q) =>
      free ? ((q - high) * first + (low - q) * last) / (high - low || 1) : j === units.length - 1 ? unitOfDrive : 0,
    );
  }

  /** Slopes of the limits that are near, by differences: rows {margin, slope}. */
  #limits(state, shares) {
    const { numbers, margins, spots } = state;
    const near = margins.flatMap((margin, k) => (margin < OPTIONS.near ? [k] : []));
    if (!near.length) return [];
    const rows = near.map((k) => ({ margin: margins[k] - INSIDE, slope: [] }));
    for (const j of numbers.keys()) {
      const moved = this.misfit.made(numbers.map((value, i) => (i === j ? value + OPTIONS.slope : value))),
        drift = this.#drift(state, shares, j);
      const after =
        moved &&
        this.bounds.margins(
          moved,
          spots.map((q, k) => q + OPTIONS.slope * drift[k]),
        );
      near.forEach((k, n) =>
        rows[n].slope.push(after?.length === margins.length ? (after[k] - margins[k]) / OPTIONS.slope : 0),
      );
    }
    return rows;
  }

  /** The step of least squares with limits that it would violate as further errors. */
  #step({ matrix, slope }, limits, damping) {
    const taken = new Set(limits.filter(({ margin }) => margin < 0));
    for (let n = 0; ; n++) {
      const left = matrix.map((row, i) => row.map((value, j) => value + (i === j ? damping : 0))),
        right = slope.map((value) => -value);
      for (const { margin, slope: row } of taken) {
        row.forEach((value, i) => {
          right[i] -= OPTIONS.penalty * margin * value;
          row.forEach((other, j) => {
            left[i][j] += OPTIONS.penalty * value * other;
          });
        });
      }
      const step = solved(left, right);
      if (!step) return null;
      const more = limits.filter((one) => !taken.has(one) && one.margin + product(one.slope, step) < 0);
      if (!more.length || n === 5) return step;
      for (const one of more) taken.add(one);
    }
  }

  /**
   * Descends from `state`, which it yields after each step; `pull` draws towards the reference, and a step that gains
   * less than the fraction `gain` is the last.
   */
  *descend(state, pull, gain) {
    const away = ({ numbers }) => squares(numbers.map((value, j) => value - this.reference[j]));
    const total = (one) => one.cost + one.penalty + pull * away(one);
    const least = pull || !this.misfit.exact ? OPTIONS.damping : OPTIONS.exact;
    let damping = least;
    for (let n = 0; n < OPTIONS.steps && state.cost + state.penalty > OPTIONS.rounding; n++) {
      const normal = this.#normal(state),
        limits = this.#limits(state, normal.shares),
        before = total(state);
      normal.slope = normal.slope.map((value, j) => value + pull * (state.numbers[j] - this.reference[j]));
      normal.matrix.forEach((row, j) => {
        row[j] += pull;
      });
      let next = null;
      for (; damping < 1e3 && !next; damping *= next ? 1 : 10) {
        const step = this.#step(normal, limits, damping);
        next =
          step &&
          this.#measured(
            state.numbers.map((value, j) => value + step[j]),
            state.drive.map((q, k) => q - product(normal.shares[k], step)),
          );
        if (next && !(total(next) < before)) next = null;
      }
      if (!next) return state;
      state = next;
      yield state;
      damping = Math.max(least, damping / 10);
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
    made =
      ({ numbers, drive }) =>
      () =>
        following.misfit.solution(numbers, drive, solution);
  const descents = function* (begin) {
    const first = following.begin(begin, reference);
    return (
      first &&
      (yield* following.descend(yield* following.descend(first, OPTIONS.pull, OPTIONS.settled), 0, OPTIONS.gain))
    );
  };
  const total = (state) => (state ? state.cost + state.penalty : Infinity);
  let found = null;
  for (const begin of new Set([solution, reference.solution])) {
    const run = descents(begin);
    let step = run.next();
    for (; !step.done; step = run.next()) yield found ? made(found) : made(step.value);
    if (total(step.value) < OPTIONS.better * total(found)) found = step.value;
  }
  if (found) yield made(found);
}
