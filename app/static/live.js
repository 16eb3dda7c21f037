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
  return report.continued.map((rank) => solutions[rank - 1]).filter((one) => one && near(one)).reduce((best, one) => better(one, best), null);
}

/** `page` has `isDragged()`, `shown()`: {answer, solution}, `fits(answer)`, and `show(answer, solution)`. */
export class Live {
  #begun = null; // what was on show when the drag began
  #next = null;
  #busy = false;
  #latest = null;

  constructor(page) {
    this.page = page;
    document.addEventListener("settled", () => { if (this.#latest && page.fits(this.#latest)) this.#show(); });
  }

  /** Follows a drag, of a `kind`, to a motion; brings back what was on show where the drag returns to its beginning. */
  follow(kind, request, motion) {
    if (this.#begun?.kind !== kind) this.#begun = { kind, ...this.page.shown() };
    this.#next = [request, motion];
    if (!this.page.fits(this.#begun.answer)) {
      if (!this.#busy) this.#ask();
      return;
    }
    this.#next = this.#latest = null;
    if (this.page.shown().answer !== this.#begun.answer) this.page.show(this.#begun.answer, this.#begun.solution);
  }

  forget() { this.#begun = this.#next = this.#latest = null; }

  /** Asks for one motion at a time; those in between are not asked for. */
  async #ask() {
    this.#busy = true;
    for (let tries = 0; this.#next && tries < RETRIES;) {
      const [wanted, motion, turn = 0] = this.#next, { mechanisms: _kinds, ...request } = wanted, begun = this.#begun;
      const starts = [...new Set([begun.solution, this.page.shown().solution])];
      this.#next = null;
      try {
        const reply = await (await ask("/v1/synthesize", { ...request, start_from: starts.map(start), budget_ms: BUDGETS_MS[turn], top: TOP })).json(), found = continuation(reply, starts);
        tries = 0;
        if (!found && turn + 1 < BUDGETS_MS.length) this.#next ??= [wanted, motion, turn + 1];
        if (!found || begun !== this.#begun || this.page.fits(begun.answer) || !(this.page.isDragged() || this.page.fits({ request: wanted }))) continue;
        this.#latest = { request: wanted, motion, reply, found };
        this.#show();
      } catch (error) { // Solve says what is wrong with a request
        if (error.status !== 503) continue;
        this.#next ??= [wanted, motion, turn];
        tries += 1;
        await new Promise((done) => { setTimeout(done, RETRY_MS); });
      }
    }
    this.#busy = false;
  }

  /** Shows only the linkage that continues while the drag lasts, then also others, and first one that is clearly better. */
  #show() {
    const { request, motion, reply, found } = this.#latest, lasts = this.page.isDragged(), [best] = reply.solutions;
    const answer = { request, reply: lasts ? { ...reply, solutions: [found] } : reply, motion, last: true, live: true, seconds: reply.report.elapsed_ms.total / 1000 };
    this.page.show(answer, !lasts && best.errors.objective < CLEARLY * found.errors.objective ? best : found);
  }
}
