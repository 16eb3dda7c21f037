// A draft: work of one's own, kept in the browser's store for each tab, named on the page and discarded there.
// A new tab, also of a later visit, begins with the last of all.

import { $, keep, listen, recall } from "./shell.js";

const TAB = "sessionStorage";

const when = (at) =>
  new Date(at).toLocaleString("en-GB", { day: "numeric", month: "long", hour: "2-digit", minute: "2-digit" });

export class Draft {
  /** A page has one under its own `name`; `open(content)` shows it or throws, `leave()` shows something else. */
  constructor(name, open, leave) {
    Object.assign(this, { name, open, leave, kept: null, text: null, shown: false, resumes: false });
    const own = recall(name, TAB),
      { at, content } = (own ?? recall(name)) || {};
    if (Number.isFinite(new Date(at).getTime())) this.#take(at, content);
    this.resumes = own !== null;
    listen("draft-open", "click", () => {
      this.restore();
      $("solve").focus();
    });
    listen("draft-discard", "click", () => {
      const { shown } = this;
      this.drop();
      if (shown) leave();
      $("solve").focus();
    });
  }

  #take(at, content) {
    Object.assign(this, { kept: { at, content }, text: JSON.stringify(content) });
  }

  /** Forgets the draft. */
  drop() {
    const { name, kept } = this;
    Object.assign(this, { kept: null, text: null, shown: false });
    if (JSON.stringify(recall(name)) === JSON.stringify(kept)) keep(name, null);
    keep(name, false, TAB); // that of another tab does not come in its place
    this.#say();
  }

  /** When the draft was stored. */
  get date() {
    return when(this.kept.at);
  }

  /** Shows the draft; false if there is none that can be read. */
  restore() {
    if (!this.kept) return false;
    try {
      this.open(this.kept.content);
      return true;
    } catch {
      this.drop();
      return false;
    }
  }

  /** The page shows `content` now, which is kept if it is the user's `own`. */
  see(content, own) {
    const text = JSON.stringify(content);
    if (own && text !== this.text) {
      const at = Date.now();
      // if the store is blocked or full, what was kept before stays
      if (keep(this.name, { at, content })) {
        this.#take(at, JSON.parse(text));
        keep(this.name, { at, content }, TAB);
      }
    }
    this.shown = text === this.text;
    this.#say();
  }

  #say() {
    $("draft").hidden = !this.kept;
    if (!this.kept) return;
    $("draft-open").hidden = this.shown;
    $("draft-text").textContent = this.shown
      ? `Draft, stored in this browser (${this.date}).`
      : `A draft of ${this.date} is stored in this browser. Your next change replaces it.`;
  }
}
