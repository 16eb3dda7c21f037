// The answer that follows a drag: the linkage on show is refined for each motion, and the last motion is always answered.

import { ask } from "./service.js";

const TOP = 3;
const BUDGET_MS = 60; // of one answer
const RETRY_MS = 300; // after a busy service has refused a request
const RETRIES = 20;
const NEAR = 0.2; // times the longest link: lengths and pivots of a linkage that continues another one differ by less

const pause = (ms) => new Promise((done) => { setTimeout(done, ms); });
const beginning = ({ links, branch, start_angle, body_offset, mount, crank_angle }) => ({ links, branch, start_angle, body_offset, mount, crank_angle });

/** Returns true if a solution continues the linkage on show, and is not another linkage with the same motion. */
function near(solution, shown) {
  const longest = Math.max(...Object.values(shown.links)), numbers = ({ links, mount }) => [...Object.values(links), ...(mount ? [...mount.pivot_a, ...mount.pivot_b] : [])];
  const before = numbers(shown);
  return solution.branch === shown.branch && numbers(solution).every((value, k) => Math.abs(value - before[k]) < NEAR * longest);
}

/** The better one of the solutions of a reply that continue the linkage on show, the last one of `starts`; null if there is none. */
function continuation({ solutions, report }, starts) {
  const found = report.continued.filter(Boolean).map((rank) => solutions[rank - 1]).filter((one) => near(one, starts.at(-1)));
  return found.reduce((best, one) => (best && best.errors.objective <= one.errors.objective ? best : one), null);
}

/** Asks for one motion at a time, beginning with the solutions of `starts()`; `show(request, motion, reply, found)` gets each answer. */
export class Live {
  #next = null;
  #busy = false;

  constructor(starts, show) {
    Object.assign(this, { starts, show });
  }

  /** Asks for a motion as soon as the one before it is answered; those in between are not asked for. */
  async follow(request, motion) {
    this.#next = [request, motion];
    if (this.#busy) return;
    this.#busy = true;
    for (let tries = 0; this.#next && tries < RETRIES;) {
      const [wanted, of] = this.#next, starts = this.starts(), { mechanisms: _kinds, ...fourBars } = wanted;
      this.#next = null;
      try {
        const body = { ...fourBars, start_from: starts.map(beginning), budget_ms: BUDGET_MS, top: TOP };
        const reply = await (await ask("/v1/synthesize", body)).json(), found = continuation(reply, starts);
        if (found) this.show(wanted, of, reply, found);
        tries = 0;
      } catch (error) { // Solve says what is wrong with a request
        if (error.status !== 503) continue;
        this.#next ??= [wanted, of];
        tries += 1;
        await pause(RETRY_MS);
      }
    }
    this.#next = null;
    this.#busy = false;
  }

  /** Drops the motion that waits. */
  forget() {
    this.#next = null;
  }
}
