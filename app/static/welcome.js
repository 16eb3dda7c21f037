// The first screen: four entries with pictures and the last project.

import { listProjects } from "./projects.js";
import { $, counted } from "./shell.js";

/** Hides the first screen; false if it was not there. */
export function leaveWelcome() {
  if ($("welcome").hidden) return false;
  $("welcome").hidden = true;
  for (const part of document.querySelectorAll(".board, .side-column")) part.inert = false;
  return true;
}

/** Shows the first screen with the `draft` as the last project, and the projects, which `open(content)` shows. */
export function showWelcome(draft, open) {
  const { request, law } = draft.kept?.content ?? {},
    { position, rotation } = request ?? {},
    rows = position ?? rotation,
    words = law ? "a function" : Array.isArray(rows) ? counted(rows.length, rotation ? "pose" : "point") : null;
  $("welcome").hidden = false;
  listProjects(open);
  for (const part of document.querySelectorAll(".board, .side-column")) part.inert = true;
  $("last-project").hidden = !words;
  if (words) $("last-project").textContent = `Continue the last project: ${words}, ${draft.date}`;
  else draft.drop();
}

/** Binds the entries to the buttons of the workspace. */
export function startWelcome(draft, open) {
  for (const entry of document.querySelectorAll("[data-begin]")) {
    entry.addEventListener("click", () => {
      if (entry.dataset.begin === "paste") leaveWelcome();
      $(entry.dataset.begin).click();
    });
  }
  $("last-project").addEventListener("click", () => {
    if (!draft.restore()) showWelcome(draft, open);
  });
}
