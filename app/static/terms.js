// The words of the trade, explained where they appear.

import { button, element } from "./drawing.js";

const TERMS = {
  "crank angles":
    "How far the crank has turned at each pose. Free: the search finds them, which is right unless something else moves with the crank.",
  "transmission angle":
    "The angle between coupler and rocker where they meet. Near 90° the force passes on well; below about 35° friction grows and play in the pins shows.",
  family:
    "Which links can turn fully. In a crank-rocker the crank turns round and the rocker swings; in a double-crank both turn; any that closes need not turn fully.",
  mechanisms:
    "Which linkages are looked for: cranks alone (four-bars), or with a rail that a point of the body runs on, or a slot of the body on a fixed pin; driven by a crank, a slider, a cylinder or a hinge. Rails and slots need angles and places. Of several kinds those are listed that no other one, driven alike, beats in error, size and transmission angle at once.",
  prefer:
    "What decides among linkages that are accurate enough: within the allowed errors or, if none are given, within 0.1 % of the motion's extent and 0.1°, else within a tenth of the least error. Balanced: size, transmission angle and swing together. Smallest: links and reach, as multiples of the motion's extent.",
  "pivot box":
    "A rectangle in which both fixed pivots must lie: drag it on the canvas with Pivot box, or type it here.",
};

/** Gives each word with `data-term` a small button that explains it. */
export function explainTerms() {
  for (const word of document.querySelectorAll("[data-term]")) {
    const name = word.dataset.term,
      note = element("span", "explanation", TERMS[name]);
    const asks = button(
      "?",
      (event) => {
        event.preventDefault();
        note.hidden = !note.hidden;
        asks.setAttribute("aria-expanded", String(!note.hidden));
      },
      "explain",
    );
    note.hidden = true;
    note.setAttribute("role", "note");
    asks.setAttribute("aria-label", `What is meant by ${name}`);
    asks.setAttribute("aria-expanded", "false");
    word.after(asks);
    (word.closest(".across, .preset > .check") ?? word.closest(".field") ?? word.parentNode).after(note);
  }
}
