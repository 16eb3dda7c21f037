// The answer that follows a drag: each search goes on from what the last one left, and the newest motion is always asked for next.

import { ask } from "./service.js";

const TOP = 3;
const ID = `page-${Math.random().toString(36).slice(2, 14).padEnd(12, "0")}`; // of this page, as the service wants it

/** Asks for one motion at a time; `show(request, motion, reply)` gets each answer. */
export class Live {
  #next = null;
  #busy = false;

  constructor(show) {
    this.show = show;
  }

  /** Asks for a motion as soon as the one before is answered; those in between are not asked for. */
  async follow(request, motion) {
    this.#next = [request, motion];
    if (this.#busy) return;
    this.#busy = true;
    try {
      while (this.#next) {
        const [wanted, of] = this.#next;
        this.#next = null;
        const { mechanisms: _kinds, ...fourBars } = wanted;
        const reply = await (await ask("/v1/synthesize", { ...fourBars, live: ID, top: TOP })).json();
        this.show(wanted, of, reply);
      }
    } catch { // what is wrong with the request Solve says
      this.#next = null;
    } finally {
      this.#busy = false;
    }
  }
}
