// The linkage on show follows what the user does to the motion, frame by frame; when that rests, the service looks for
// better ones.

import { verdictOf } from "./bounds.js";
import { alike } from "./fit.js";
import { followed } from "./follow.js";
import { toRequest } from "./formats.js";
import { measured } from "./hand.js";
import { fault } from "./motion.js";
import { less, size } from "./plane.js";
import { ask } from "./service.js";
import { defects } from "./verdict.js";

const SLICE_MS = 7; // of each frame: more of a descent waits for the next one
const REST_MS = 250; // without a change by keys, after which a linkage has been moved
const BUDGET_MS = 1000; // of the search for better ones
const ROUNDING = 1e-10; // error that is none
const BETTER = 0.8; // times the error of the linkage that was moved: another one with less is offered

// kinds of changes, by their first words
const FOLLOWED = ["drag", "key", "cell", "box", "box-0", "box-1", "box-2", "box-3"];

/** Return true if a linkage can follow a changed motion: only poses, crank angles and limits may differ. */
function followable(motion, before) {
  const fixed = ["wanted", "timing", "direction", "anyOrder", "closed", "unit"],
    isCompatible = fixed.every((name) => motion[name] === before[name]);
  return isCompatible && motion.poses.length === before.poses.length && !fault(motion);
}

/**
 * The answer that a moved linkage makes to a motion, in place of the one `before`; errors and verdict are computed in
 * the page.
 */
function answerOf(solution, motion, before) {
  const { solution: moved, fit } = measured(solution, motion),
    report = { ...before.reply.report, trace: [], notes: [] },
    solutions = [{ ...moved, verdict: verdictOf(moved, motion, fit) }];
  const reply = { status: "closest", solutions, report };
  return { request: toRequest(motion), motion, reply, last: true, live: true, seconds: 0 };
}

/**
 * The linkage moves from a `reference`, the last one that was not moved. `page` has `answer()`, `fits(answer)` to the
 * motion, `display(answer, solution)`, `stop()` for a search that runs, and `say()`.
 */
export class Live {
  #reference = null; // {answer, solution, motion}
  #moved = null; // the linkage that was moved last
  #run = null; // {motion, own, k, from, reached, steps, drawn, rests}; its limits are its `own` where a pivot is pulled
  #searching = null; // AbortController

  constructor(editor, results, page) {
    Object.assign(this, { editor, results, page });
    document.addEventListener("settled", () => this.#rest());
  }

  /** The motion that the linkage follows, until it has been moved. */
  get motion() {
    return this.#run?.motion ?? null;
  }

  get #can() {
    const { editor, results, page } = this;
    return Boolean(results.solution) && !editor.fault && followable(editor.motion, page.answer().motion);
  }

  /** Follows a change of the motion if its `kind` moves poses or the pivot box; any other ends it. */
  change(kind) {
    const [first, ...more] = (kind ?? "").split(" "),
      { limits } = this.editor.motion;
    const k = first.startsWith("box") ? null : Number(more[0]?.match(/\d+/));
    if (FOLLOWED.includes(first) && this.#can) this.#follow(limits, k);
    else this.forget();
  }

  /** Follows a fixed pivot that is dragged to a place. */
  pull(joint, position) {
    if (!this.#can) return;
    const { limits } = this.editor.motion,
      extra = { ...limits.extra, [`pivot_${joint}`]: position };
    this.editor.keep(`pivot ${joint}`);
    this.#follow({ ...limits, extra }, null, (joints) => size(less(joints[joint], position)) === 0);
  }

  /**
   * Follows the motion within `limits`, in which pose `k` is moved or null; where it is `back`, what was shown before
   * is restored.
   */
  #follow(limits, k, back = () => this.page.fits(this.#reference.answer)) {
    const answer = this.page.answer(),
      { solution } = this.results,
      motion = structuredClone(this.editor.motion),
      before = this.#run;
    this.page.stop();
    this.#searching?.abort();
    if (!before && solution !== this.#moved) {
      this.#reference = { answer, solution, motion: answer.motion, joints: this.editor.board.joints };
    }
    if (back(this.#reference.joints)) {
      this.#run = null;
      clearTimeout(this.timer);
      this.page.display(this.#reference.answer, this.#reference.solution);
      return;
    }
    const from = before?.reached ?? before?.from ?? solution,
      steps = followed({ ...motion, limits }, from, this.#reference),
      own = limits !== this.editor.motion.limits;
    this.#run = { motion, own, k, from, reached: null, steps, drawn: true };
    this.#advance();
    this.#soon();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => {
      if (!this.editor.board.held) this.#rest();
    }, REST_MS);
  }

  /** Ends it all: something else is shown. */
  forget() {
    clearTimeout(this.timer);
    this.#searching?.abort();
    if (this.#run) this.results.untrack();
    this.#run = null;
  }

  /** Goes on with the descent for a slice of a frame, and shows how far it has come. */
  #advance() {
    const run = this.#run,
      end = performance.now() + SLICE_MS;
    let solutionOf = null;
    while (run.steps && performance.now() < end) {
      const { value, done } = run.steps.next();
      if (done) run.steps = null;
      else solutionOf = value ?? solutionOf;
    }
    if (!solutionOf) return;
    run.reached = solutionOf();
    this.results.track(run.reached, run.motion, run.k);
  }

  #soon() {
    this.frame ??= requestAnimationFrame(() => {
      this.frame = null;
      if (this.#run) this.#tick();
    });
  }

  #tick() {
    // a change since the last frame is drawn by what brings it
    if (this.#run.steps && !this.#run.drawn) {
      this.#advance();
      this.editor.board.draw();
    }
    this.#run.drawn = false;
    if (!this.#run.steps && this.#run.rests) this.#land();
    else this.#soon();
  }

  /** Mark the user's change as finished: the linkage is final once its descent is over. */
  #rest() {
    if (this.#run) this.#run.rests = true;
  }

  /** Shows the linkage that was moved as the answer. */
  #land() {
    const { motion, reached, from, k, own } = this.#run,
      { player } = this.results,
      answer = answerOf(reached ?? from, motion, this.page.answer()),
      [moved] = answer.reply.solutions;
    this.#run = null;
    this.page.display(answer, moved);
    if (k !== null) player.goto(player.shown.pass.angles[k]);
    // a pivot that was put by hand stays where it is: what follows begins there
    this.#moved = own ? null : moved;
    this.#search(answer, moved);
  }

  /** Searches for others; they are listed beside the linkage that was moved, which stays. */
  async #search(answer, moved) {
    const { request } = answer,
      control = new AbortController();
    this.#searching = control;
    const begin = request.start_angle === undefined ? { start_from: [moved] } : {};
    try {
      const question = { ...request, ...begin, budget_ms: BUDGET_MS },
        { solutions, report } = await (await ask("/v2/synthesize", question, control.signal)).json(),
        shown = answer.reply.solutions,
        isNew = (candidate) => !shown.some((known) => alike(candidate, known)),
        additions = solutions.filter(isNew).map((solution, k) => ({ ...solution, rank: k + 1 })),
        [first] = additions;
      if (control.signal.aborted || !first) return;
      const { objective } = first.errors,
        { length_scale } = answer.reply.report,
        nearer = objective < BETTER * moved.errors.objective && objective > ROUNDING;
      first.better = nearer && !defects(first.verdict).length;
      answer.reply = { ...answer.reply, report: { ...report, length_scale }, solutions: [...shown, ...additions] };
      if (answer !== this.page.answer()) return;
      this.results.extend();
      this.page.say();
    } catch {
      /* Solve says what is wrong with a request */
    }
  }
}
