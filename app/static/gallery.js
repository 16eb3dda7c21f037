// The gallery of machines: each with a picture of the linkage found for it, its error, and one press to open it.

import { button, element, text, thumbnail } from "./drawing.js";
import { fitOf, worstRows } from "./fit.js";
import { fromRequest } from "./formats.js";
import { placesOf } from "./motion.js";
import { RAD } from "./plane.js";
import { $, listen } from "./shell.js";

/** Return the gallery's sentence about an example's stored reply. */
function honest(reply, motion) {
  const best = reply.solutions[0],
    rows = worstRows(fitOf(best, motion), motion, reply.report.length_scale ?? 1),
    errors = rows.map(([, error]) => error).join(", ");
  return `off by at most ${errors}; transmission angle ${text(best.transmission_angle_min, 2)}° or more`;
}

export class Gallery {
  /** `open(name)` opens an example, `openLaw(law)` the law of a lesson. */
  constructor(open, openLaw) {
    this.open = open;
    for (const lesson of document.querySelectorAll("[data-lesson]"))
      lesson.addEventListener("click", () => {
        $("gallery").close();
        openLaw(JSON.parse(lesson.dataset.lesson));
      });
    listen("open-gallery", "click", () => $("gallery").showModal());
    listen("gallery-close", "click", () => $("gallery").close());
    listen("gallery", "click", ({ target }) => target === $("gallery") && target.close());
  }

  show(examples) {
    for (const { name, title, word, machine, request, reply } of examples) {
      const act = () => {
          $("gallery").close();
          this.open(name);
        },
        opens = button(title, act, machine ? "machine" : "link", { "data-example": name });
      if (!machine) {
        $("others").append(opens, " ");
        continue;
      }
      const motion = fromRequest(request),
        { linkage, pass } = fitOf(reply.solutions[0], motion),
        ends = [pass.low, pass.high].map((travel) => pass.sense * travel * RAD);
      opens.replaceChildren(
        thumbnail(linkage, ends, placesOf(motion), 200, 120),
        element("strong", "", title),
        element("span", "", word),
        element("span", "muted", honest(reply, motion)),
      );
      $("machines").append(element("li", "", opens));
    }
  }
}
