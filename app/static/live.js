// The answer that follows a drag: the linkage on show is refined for each motion, and the last motion is always answered.

import { ask } from "./service.js";

const TOP = 3;
const BUDGETS_MS = [60, 500]; // of each answer, and of a second one to the last motion where the first did not continue the linkage
const RETRY_MS = 300; // after a busy service has refused a request
const RETRIES = 20;
const NEAR = 0.4; // times the longest link: lengths and pivots of a linkage that continues another one differ by less
const CLEARLY = 0.5; // times the error of the linkage on show: another one with less takes its place when the user lets go

const start = ({ links, branch, start_angle, body_offset, mount, crank_angle }) => ({ links, branch, start_angle, body_offset, mount, crank_angle });
const numbers = ({ links, mount }) => [...Object.values(links), ...(mount ? [...mount.pivot_a, ...mount.pivot_b] : [])];
const better = (one, other) => (other && other.errors.objective <= one.errors.objective ? other : one);

/** The best solution of a reply that continues the linkage on show, the last one of `starts`; null if there is none. */
function continuation({ solutions, report }, starts) {
  const shown = starts.at(-1), before = numbers(shown), most = NEAR * Math.max(...Object.values(shown.links));
  const near = (one) => one.branch === shown.branch && numbers(one).every((value, k) => Math.abs(value - before[k]) < most);
  return report.start_from_ranks.map((rank) => solutions[rank - 1]).filter((one) => one && near(one)).reduce((best, one) => better(one, best), null);
}

/** `page` has `isDragged()`, `shown()`: {answer, solution}, `fits(answer)`, and `show(answer, solution)`. */
export class Live {
  #drag = null; // {kind, answer, solution}: what was on show when the drag began; each drag is an object of its own
  #next = null; // the question that is sent next: {drag, request, motion, turn}
  #latest = null; // the last answer that continues the linkage on show
  #busy = false;

  constructor(page) {
    this.page = page;
    document.addEventListener("settled", () => { if (this.#latest && page.fits(this.#latest)) this.#show(); });
  }

  /** Follows a drag, of a `kind`, to a motion; brings back what was on show where the drag returns to its beginning. */
  follow(kind, request, motion) {
    if (this.#drag?.kind !== kind) this.#drag = { kind, ...this.page.shown() };
    const drag = this.#drag;
    if (!this.page.fits(drag.answer)) {
      this.#next = { drag, request, motion, turn: 0 };
      this.#askAll();
      return;
    }
    this.#next = this.#latest = null;
    if (this.page.shown().answer !== drag.answer) this.page.show(drag.answer, drag.solution);
  }

  forget() { this.#drag = this.#next = this.#latest = null; }

  /** Asks one question at a time, the latest; those in between are not asked. */
  async #askAll() {
    if (this.#busy) return;
    this.#busy = true;
    try {
      for (let refusals = 0; this.#next && refusals < RETRIES;) {
        const question = this.#next;
        this.#next = null;
        const { again, refused } = await this.#ask(question);
        refusals = refused ? refusals + 1 : 0;
        // only the drag that asked may ask again, unless it has moved on meanwhile
        if (again && question.drag === this.#drag) this.#next ??= again;
      }
    } finally { this.#busy = false; }
  }

  /** Asks a question and shows its answer; returns the question to ask `again`, and whether the service has `refused` it. */
  async #ask(question) {
    const { drag, request: { mechanisms: _kinds, ...request }, motion, turn } = question;
    const starts = [...new Set([drag.solution, this.page.shown().solution])].filter((one) => one?.links);
    if (!starts.length) return {};
    let reply = null;
    try {
      reply = await (await ask("/v2/synthesize", { ...request, ...(request.start_angle === undefined ? { start_from: starts.map(start) } : {}), budget_ms: BUDGETS_MS[turn], top: TOP })).json();
    } catch (error) {
      if (error.status !== 503) return {}; // Solve says what is wrong with a request
      await new Promise((done) => { setTimeout(done, RETRY_MS); });
      return { again: question, refused: true };
    }
    const found = continuation(reply, starts);
    if (!found) return { again: turn + 1 < BUDGETS_MS.length ? { ...question, turn: turn + 1 } : null };
    const late = drag !== this.#drag || this.page.fits(drag.answer);
    if (late || !(this.page.isDragged() || this.page.fits(question))) return {};
    this.#latest = { request: question.request, motion, reply, found };
    this.#show();
    return {};
  }

  /** Shows only the linkage that continues while the drag lasts, then also others, and first one that is clearly better. */
  #show() {
    const { request, motion, reply, found } = this.#latest, lasts = this.page.isDragged(), [best] = reply.solutions;
    const answer = { request, reply: lasts ? { ...reply, solutions: [found] } : reply, motion, last: true, live: true, seconds: reply.report.elapsed_ms.total / 1000 };
    this.page.show(answer, !lasts && best.errors.objective < CLEARLY * found.errors.objective ? best : found);
  }
}
