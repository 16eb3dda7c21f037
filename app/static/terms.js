// The words of the trade, explained where they appear: `data-term` of a word names its explanation in the list `terms`.

import { button, element } from "./drawing.js";
import { $ } from "./shell.js";

/** Gives each word with `data-term` a small button that explains it. */
export function explainTerms() {
  const explanations = new Map(
    [...$("terms").querySelectorAll("dt")].map((term) => [term.textContent, term.nextSibling]),
  );
  for (const word of document.querySelectorAll("[data-term]")) {
    const name = word.dataset.term,
      note = element("span", "explanation", explanations.get(name).textContent),
      labels = { "aria-label": `What is meant by ${name}`, "aria-expanded": "false" };
    const helpButton = button("?", () => {}, "explain", labels);
    helpButton.onclick = (event) => {
      event.preventDefault();
      note.hidden = !note.hidden;
      helpButton.setAttribute("aria-expanded", String(!note.hidden));
    };
    Object.assign(note, { hidden: true, role: "note" });
    word.after(helpButton);
    (word.closest(".across, .preset > .check") ?? word.closest(".field") ?? word.parentNode).after(note);
  }
}
