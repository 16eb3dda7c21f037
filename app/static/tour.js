// The guided tour in five steps, and the words of the trade explained where they appear.

import { button, element } from "./drawing.js";
import { $ } from "./shell.js";

const STEPS = [
  [".tasks", "What do you have?", "Poses of a body, a path of a point, or a function of the crank's angle. Each button begins a new task; undo brings the old one back. Machines… opens one of eight that are solved already, Linkage… takes one that you have."],
  [".canvas-frame", "Where it shall be", "The canvas shows the wanted poses with their numbers. Drag them, or draw a path. The linkage that runs meets them as well as it can; red lines are its errors."],
  ["#poses", "In numbers", "Every pose is a row: type, paste from a spreadsheet, or open a file. An empty cell is not asked for. Crank angles are free unless you give them."],
  ["#limits", "Limits", "With free crank angles the practical limits are on, with given ones off. Each can be changed or switched off; a box for the pivots, lengths and allowed errors can be added."],
  ["#solve", "Search", "Solve searches for some seconds and shows the best so far; Stop keeps it. Cards name the largest error and what is wrong; below them are curves, numbers, files and a sheet to print."],
];

const TERMS = {
  "crank angles": "How far the crank has turned at each pose. Free: the search finds them, which is right unless something else moves with the crank.",
  "transmission angle": "The angle between coupler and rocker where they meet. Near 90° the force passes on well; below about 35° friction grows and play in the pins shows.",
  family: "Which links can turn fully. In a crank-rocker the crank turns round and the rocker swings; in a double-crank both turn; any that closes need not turn fully.",
  mechanisms: "Which linkages are looked for: cranks alone (four-bars), or with a rail that a point of the body runs on, or a slot of the body on a fixed pin; driven by a crank, a slider, a cylinder or a hinge. Rails and slots need angles and places. Of several kinds those are listed that no other one, driven alike, beats in error, size and transmission angle at once.",
  prefer: "What decides among linkages that are accurate enough: within the allowed errors or, if none are given, within 0.1 % of the motion's extent and 0.1°, else within a tenth of the least error. Balanced: size, transmission angle and swing together. Smallest: links and reach, as multiples of the motion's extent.",
  "pivot box": "A rectangle in which both fixed pivots must lie: drag it on the canvas with Pivot box, or type it here.",
};

/** Gives each word with `data-term` a small button that explains it. */
export function explainTerms() {
  for (const word of document.querySelectorAll("[data-term]")) {
    const name = word.dataset.term, note = element("span", "explanation", TERMS[name]);
    const asks = button("?", (event) => {
      event.preventDefault();
      note.hidden = !note.hidden;
      asks.setAttribute("aria-expanded", String(!note.hidden));
    }, "explain");
    note.hidden = true;
    note.setAttribute("role", "note");
    asks.setAttribute("aria-label", `What is meant by ${name}`);
    asks.setAttribute("aria-expanded", "false");
    word.after(asks);
    (word.closest(".across, .preset > .check") ?? word.closest(".field") ?? word.parentNode).after(note);
  }
}

export function startTour() {
  let at = 0, back = null;
  const clear = () => document.querySelector(".toured")?.classList.remove("toured");
  const end = () => { clear(); $("tour").hidden = true; back?.focus(); };
  const show = () => {
    clear();
    const [selector, title, words] = STEPS[at], target = document.querySelector(selector), box = $("tour");
    target.classList.add("toured");
    target.scrollIntoView({ block: "center" });
    $("tour-title").textContent = title;
    $("tour-text").textContent = words;
    $("tour-count").textContent = `${at + 1} of ${STEPS.length}`;
    $("tour-next").textContent = at + 1 < STEPS.length ? "Next" : "Done";
    box.hidden = false;
    const frame = target.getBoundingClientRect(), below = frame.bottom + box.offsetHeight + 12 < innerHeight;
    box.style.top = `${Math.max(8, Math.min(innerHeight - box.offsetHeight - 8, below ? frame.bottom + 10 : frame.top - box.offsetHeight - 10))}px`;
    box.style.left = `${Math.max(8, Math.min(innerWidth - box.offsetWidth - 8, frame.left))}px`;
    $("tour-next").focus({ preventScroll: true });
  };
  $("start-tour").addEventListener("click", () => { at = 0; back = document.activeElement; show(); });
  $("tour-next").addEventListener("click", () => { at += 1; if (at < STEPS.length) show(); else end(); });
  $("tour-end").addEventListener("click", end);
  $("tour").addEventListener("keydown", (event) => { if (event.key === "Escape") end(); });
}
