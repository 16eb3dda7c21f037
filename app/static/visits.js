// Solved states as entries of the browser's history, through which Back and Forward step.

const MOST = 50; // entries whose answers are kept in memory

export class Visits {
  #entries = new Map();
  #count = 0;

  /**
   * `show(answer, left)` shows an answer of this page again, and the question as it was left there if it was changed;
   * `ask(question)` asks again what a page before a reload had solved.
   */
  constructor(show, ask) {
    addEventListener("popstate", ({ state }) => {
      if (!state?.visit) return;
      const entry = this.#entries.get(state.visit);
      if (!entry) ask(state.question);
      else show(entry.answer, JSON.stringify(entry.left) === JSON.stringify(state.question) ? null : entry.left);
    });
  }

  /**
   * Makes an entry of an answer to `question`, plain values that say all that the page asks; `hash` is the fragment of
   * its address. The first answer, and one to the question of the present entry, take the place of that entry.
   */
  add(question, answer, hash = location.hash) {
    const visit = `${Date.now()}-${++this.#count}`,
      isRepeated = JSON.stringify(history.state?.question) === JSON.stringify(question);
    const address = `${location.pathname}${location.search}${hash}`;
    this.leave(null); // the question that was changed there is the one that is answered here
    this.#entries.set(visit, { answer, left: null });
    if (this.#entries.size > MOST) this.#entries.delete(this.#entries.keys().next().value);
    if (isRepeated || !history.state?.visit) history.replaceState({ visit, question }, "", address);
    else history.pushState({ visit, question }, "", address);
  }

  /** Keeps the question of the present entry as it was changed to, for when it comes back. */
  leave(question) {
    const entry = this.#entries.get(history.state?.visit);
    if (entry) entry.left = question;
  }
}

/** Changes the fragment of the page's address; the entry stays the same. */
export const readdress = (hash) =>
  history.replaceState(history.state, "", `${location.pathname}${location.search}${hash}`);
