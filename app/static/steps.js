// The steps of the panel beside the canvas, of which one is open; on a narrow screen the panel is a sheet that folds.

import { $, rove } from "./shell.js";

const narrow = matchMedia("(max-width: 900px)");

/** Return true if the panel is a sheet below the canvas. */
export const isNarrow = () => narrow.matches;
const tabs = () => [...$("steps").children];

/** Hides the body of the sheet of a narrow screen, or shows it. */
export function fold(folded) {
  document.body.classList.toggle("folded", folded && narrow.matches);
}

/** Opens the step whose tab is "tab-" and `name`. */
export function openStep(name) {
  fold(false);
  for (const tab of tabs()) {
    const open = tab.id === `tab-${name}`,
      panel = $(tab.getAttribute("aria-controls"));
    if (open && panel.hidden) $("steps-body").scrollTop = 0;
    tab.setAttribute("aria-selected", String(open));
    tab.tabIndex = open ? 0 : -1;
    panel.hidden = !open;
  }
}

/** Opens the step and the fold in which an element lies, and moves the focus to it. */
export function focusOn(element) {
  const step = element?.closest(".step");
  if (step) openStep(step.id);
  element?.closest("details")?.setAttribute("open", "");
  element?.focus?.();
}

/** Binds the tabs; arrow keys lead from one to the next. On a narrow screen a press on the open one folds the sheet. */
export function startSteps() {
  $("steps").addEventListener("click", ({ target }) => {
    const tab = target.closest("[role=tab]");
    if (!tab) return;
    const folds =
      narrow.matches && tab.getAttribute("aria-selected") === "true" && !document.body.classList.contains("folded");
    openStep(tab.getAttribute("aria-controls"));
    fold(folds);
  });
  rove("steps", tabs, (next) => openStep(next.getAttribute("aria-controls")));
  // on a narrow screen a press elsewhere closes the menu of projects
  document.addEventListener("click", ({ target }) => {
    const open = $("extra").classList.contains("open"),
      opens = target.closest("#more") ? !open : open && Boolean(target.closest("#project-name"));
    $("extra").classList.toggle("open", opens);
    $("more").setAttribute("aria-expanded", String(opens));
  });
  $("modes").addEventListener("click", ({ target }) => {
    if (target.closest("[data-mode]")) fold(true);
  });
}
