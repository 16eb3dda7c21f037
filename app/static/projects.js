// Named projects in the browser's store: saved under a name, opened from the first screen, and deleted there.

import { button, element } from "./drawing.js";
import { $, keep, recall } from "./shell.js";

const KEY = "linkage-atlas-projects";

/** Contents by name; none where the store holds something else. */
function stored() {
  const found = recall(KEY);
  return found && typeof found === "object" && !Array.isArray(found) ? found : {};
}

/** Stores all projects. Throws an error if the browser does not allow it. */
function store(projects) {
  if (!keep(KEY, projects))
    throw new Error("The project was not saved: the browser's storage is blocked or full. Save a file instead.");
}

/** Lists the projects on the first screen; `open(content)` shows one. */
export function listProjects(open) {
  const names = Object.keys(stored()).sort();
  $("projects").hidden = !names.length;
  const remove = (name) => {
    const { [name]: _, ...remaining } = stored();
    store(remaining);
    listProjects(open);
  };
  const item = (name) => {
    const deleteButton = button("×", () => remove(name), "quiet", { "aria-label": `Delete the project ${name}` });
    return element(
      "li",
      "",
      button(name, () => open(stored()[name]), "link"),
      deleteButton,
    );
  };
  $("project-list").replaceChildren(...names.map(item));
}

/** Binds the field that saves: `content()` is what a project holds, `say(sentence, bad)` tells the user. */
export function startProjects(content, say) {
  $("project-form").addEventListener("submit", (event) => {
    event.preventDefault();
    const name = $("project-name").value.trim();
    try {
      if (!name) throw new Error("A project needs a name.");
      store({ ...stored(), [name]: content() });
      say(`The project ${name} is saved in this browser.`);
    } catch (error) {
      say(error.message, true);
    }
  });
}
