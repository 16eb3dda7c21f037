// The gallery of machines: each with a picture of the linkage found for it, its error, and one press to open it.

import { button, element, text, thumbnail } from "./drawing.js";
import { fitOf, worstRows } from "./fit.js";
import { fromRequest } from "./formats.js";
import { placesOf } from "./motion.js";
import { RAD } from "./plane.js";
import { $ } from "./shell.js";

/** What the gallery says of an example's stored reply. */
function honest(reply, motion) {
  const best = reply.solutions[0],
    fit = fitOf(best, motion);
  const errors = worstRows(fit, motion, reply.report.length_scale ?? 1)
    .map(([, error]) => error)
    .join(", ");
  return `off by at most ${errors}; transmission angle ${text(best.transmission_angle_min, 2)}° or more`;
}

/** Linkages for lessons: title and law. */
const LESSONS = {
  "Slider-crank": { drive: "crank_slider", name: "quick", stroke: "60", "time-ratio": "1" },
  "Quick return": { drive: "crank_slider", name: "quick", stroke: "120", "time-ratio": "1.2" },
};

export class Gallery {
  /** `open(name)` opens an example, `openLaw(law)` the law of a lesson. */
  constructor(open, openLaw) {
    this.open = open;
    for (const [title, law] of Object.entries(LESSONS)) {
      const act = () => {
        $("gallery").close();
        openLaw(law);
      };
      $("lessons").append(button(title, act, "link"), " ");
    }
    $("open-gallery").addEventListener("click", () => $("gallery").showModal());
    $("gallery-close").addEventListener("click", () => $("gallery").close());
    $("gallery").addEventListener("click", (event) => {
      if (event.target === $("gallery")) $("gallery").close();
    });
  }

  show(examples) {
    for (const { name, title, word, machine, request, reply } of examples) {
      const opens = button(
        title,
        () => {
          $("gallery").close();
          this.open(name);
        },
        machine ? "machine" : "link",
      );
      opens.dataset.example = name;
      if (!machine) {
        $("others").append(opens, " ");
        continue;
      }
      const motion = fromRequest(request),
        best = reply.solutions[0],
        {
          linkage,
          pass: { sense, low, high },
        } = fitOf(best, motion);
      opens.replaceChildren(
        thumbnail(linkage, [sense * low * RAD, sense * high * RAD], placesOf(motion), 200, 120),
        element("strong", "", title),
        element("span", "", word),
        element("span", "muted", honest(reply, motion)),
      );
      const item = document.createElement("li");
      item.append(opens);
      $("machines").append(item);
    }
  }
}
