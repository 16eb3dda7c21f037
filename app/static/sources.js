// Where a motion comes from: an example, pasted rows, a file or a link; and the links to a request.

import { fromCsv, fromFragment, fromRequest, toCsv, toFragment } from "./formats.js";
import { emptyMotion } from "./motion.js";
import { download } from "./service.js";
import { $, say } from "./shell.js";

const MAX_FILE_BYTES = 2e6;

export class Sources {
  /**
   * `current()` is the motion whose settings pasted rows keep; `use(motion, mode, fit)` takes a new one, for a mode of the canvas,
   * fitted into the view or not.
   */
  constructor(current, use) {
    Object.assign(this, { current, use, examples: [], ownFragment: null });
    $("example").addEventListener("change", () => this.useExample($("example").value));
    $("clear").addEventListener("click", () => this.#take(emptyMotion(), { mode: "add" }));
    $("new-path").addEventListener("click", () => this.#take(emptyMotion("position"), { mode: "path" }));
    $("save").addEventListener("click", () => download(new Blob([toCsv(this.current())], { type: "text/csv" }), "motion.csv"));
    this.#bindPaste();
    this.#bindFiles();
    addEventListener("hashchange", () => { this.openLink().catch((error) => say(error.message, true)); });
  }

  async loadExamples() {
    try {
      this.examples = await (await fetch("/static/examples.json")).json();
    } catch { say("The examples cannot be loaded.", true); }
    for (const { name, title } of this.examples) $("example").append(new Option(title, name));
  }

  /** Does nothing for a name that no example has. */
  useExample(name) {
    const example = this.examples.find((one) => one.name === name);
    if (example) this.#take(fromRequest(example.request), { name, note: example.word, mode: "move" });
  }

  /** Takes a path drawn by hand: places only, free crank angles, the limits of the motion before. */
  useDrawn(places, closed) {
    const { limits, tolerance, top, round } = this.current();
    const motion = Object.assign(emptyMotion("position"), { closed, limits, top, round, tolerance: { ...tolerance, rotation: null } });
    motion.poses = places.map(([x, y], k) => ({ t: k, x, y, angle: 0 }));
    const note = places.length > 1 ? `Drawn by hand: ${places.length} points${closed ? " of a closed way" : ""}, crank angles free. Move points, or solve.` : "";
    this.#take(structuredClone(motion), { note, fit: false });
  }

  /** Takes the motion from the page's address; false if there is none. Throws for a damaged one. */
  async openLink() {
    if (location.hash === this.ownFragment) return false;
    const request = await fromFragment(location.hash);
    if (!request) return false;
    this.#take(fromRequest(request), { note: "From a link" });
    return true;
  }

  /** The page's address with the request in it, which the address bar shows from now on. */
  async linkTo(request) {
    const url = new URL(location.href);
    url.hash = await toFragment(request);
    this.ownFragment = url.hash;
    history.replaceState(null, "", url);
    return url.href;
  }

  #take(motion, { name = "", note = "", mode = null, fit = true }) {
    $("example").value = name;
    $("example-note").textContent = note;
    this.use(motion, mode, fit);
  }

  /** The motion in CSV or in a request, also as exported with its solution. Throws for anything else. */
  #read(content) {
    const start = content.trimStart();
    if (!start.startsWith("{")) return fromCsv(content, this.current());
    let body;
    try { body = JSON.parse(start); } catch (error) { throw new Error("The file is not valid JSON.", { cause: error }); }
    return fromRequest(body.request ?? body);
  }

  #bindPaste() {
    const box = $("paste-box");
    $("paste").addEventListener("click", () => { box.hidden = !box.hidden; if (!box.hidden) $("paste-text").focus(); });
    $("paste-cancel").addEventListener("click", () => { box.hidden = true; });
    $("paste-use").addEventListener("click", () => {
      try {
        this.#take(this.#read($("paste-text").value), {});
        box.hidden = true;
        $("paste-error").textContent = "";
      } catch (error) { $("paste-error").textContent = error.message; }
    });
  }

  #bindFiles() {
    const take = async (file) => {
      if (!file) return;
      try {
        if (file.size > MAX_FILE_BYTES) throw new Error("The file is larger than 2 MB, which is too large for a motion.");
        this.#take(this.#read(await file.text()), { note: `From ${file.name}` });
      } catch (error) { say(error.message, true); }
    };
    $("open").addEventListener("click", () => $("file").click());
    $("file").addEventListener("change", () => { take($("file").files[0]); $("file").value = ""; });
    document.addEventListener("dragover", (event) => event.preventDefault());
    document.addEventListener("drop", (event) => { event.preventDefault(); take(event.dataTransfer.files[0]); });
  }
}
