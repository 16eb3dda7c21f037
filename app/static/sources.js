// Sources of a motion: an example, pasted rows, a file or a link; and the links to a request.

import { toCsv, withSamples } from "./csv.js";
import { fromPage, fromRequest, toPage, toRequest } from "./formats.js";
import { fromFragment } from "./link.js";
import { firstLaw } from "./law.js";
import { dropClosing, emptyMotion, itemOf, jump, looksRadian, repeated, unwrapped } from "./motion.js";
import { RAD } from "./plane.js";
import { download } from "./service.js";
import { $, capital, listen, say } from "./shell.js";
import { readTable } from "./tables.js";

const MAX_TEXT_BYTES = 2e7;
const MAX_ROWS = 1000; // the service takes 1024 and the request a megabyte
const TAKEN =
  "The page takes tables (CSV, TSV, text), requests (JSON), outlines of the body (SVG, DXF) " +
  "and pictures to trace (PNG, JPEG, WebP).";
const ROLES = ["x", "y", "angle", "crank"];

/** Return the content of a motion's link, for comparison. */
const contentOf = (motion) => JSON.stringify(toPage(toRequest(motion), motion));

/** Actions for files other than tables and requests, by their extensions. */
const FILES = new Map([
  [/\.(svg|dxf)$/i, "outline"],
  [/\.(png|jpe?g|webp)$/i, "picture"],
  [/\.(xlsx?|ods|numbers)$/i, "is a spreadsheet: copy its rows and paste them into the table, or save it as CSV."],
  [/\.(step|stp|stl|3mf|obj|igs|iges|sldprt|ipt)$/i, "is a solid model: save the outline of the body as SVG or DXF."],
  [/\.(pdf|docx?|pptx?|odt|mp4|webm|mov|avi|gif|zip)$/i, `cannot be used here. ${TAKEN}`],
]);

/** A table that is too long, with even steps between the rows that stay, and a sentence on it; null for any other. */
async function thinned(source) {
  if (source.size > MAX_TEXT_BYTES) throw new Error("The file is larger than 20 MB, which is too large for a table.");
  const content = typeof source === "string" ? source : await source.text();
  if (content.includes("\0")) throw new Error(`The file contains no text. ${TAKEN}`);
  const lines = content.split(/\r\n|\r|\n/).filter((line) => line.trim()),
    first = lines.findIndex((line) => /^\s*["']?[-+−]?[.,]?\d/.test(line)),
    count = lines.length - first;
  if (first < 0 || count <= MAX_ROWS) return null;
  const step = Math.ceil((count - 1) / (MAX_ROWS - 1)),
    stays = (k) => k < first || (k - first) % step === 0;
  return [
    lines.filter((_, k) => stays(k)).join("\n"),
    `One row in ${step} is used, because the table has ${count} rows and at most ${MAX_ROWS} are allowed.`,
  ];
}

export class Sources {
  /**
   * `current()` is the motion whose settings pasted rows keep; `use(motion, {mode, fit, reply, card})` takes a new one,
   * for a mode of the canvas, fitted into the view or not, with the stored reply of an example or the card of a link.
   */
  constructor(current, use) {
    Object.assign(this, { current, use, examples: [], shown: null, asCame: new Set(), linked: false, reading: null });
    listen("new-motion", "click", () => this.begin("both"));
    listen("new-path", "click", () => this.begin("position"));
    listen("new-function", "click", () => this.begin("function"));
    const csv = () => new Blob([toCsv(this.current())], { type: "text/csv" });
    listen("save", "click", () => download(csv(), "motion.csv"));
    this.#bindPaste();
    this.#bindFiles();
    this.#bindColumns();
  }

  async loadExamples() {
    try {
      this.examples = await (await fetch("/static/examples.json")).json();
      for (const { request } of this.examples) this.asCame.add(contentOf(fromRequest(request)));
    } catch {
      say("The examples cannot be loaded. Reload the page to try again.", true);
    }
  }

  /** Begins a new motion, path or function that keeps the unit; a function perhaps with `fields` of its law. */
  begin(kind, fields = {}) {
    const law = kind === "function" ? { ...firstLaw(), ...fields } : null;
    const mode = { both: "add", position: "path", function: "move" }[kind];
    this.#take({ ...emptyMotion(kind), law, unit: this.current().unit }, { mode });
  }

  /** Does nothing for a name that no example has. */
  useExample(name) {
    const example = this.examples.find((entry) => entry.name === name);
    if (example) this.#open(example, { mode: "move" });
  }

  /** Takes the motion of an example with the answer that was computed beforehand. */
  #open(example, how) {
    const { request, reply, title, word } = example;
    this.#take(fromRequest(request), { note: `${title}. ${word}`, reply: structuredClone(reply), ...how });
    this.shown = example;
  }

  /** Takes a path drawn by hand: places only, free crank angles, the limits of the motion before. */
  useDrawn(points, closed) {
    const { limits, tolerance, top, round, unit, diverse } = this.#settings(),
      poses = points.map(([x, y], k) => ({ t: k, x, y, angle: 0 })),
      count = `${points.length} points${closed ? " of a closed path" : ""}`,
      note = points.length > 1 ? `Drawn by hand: ${count}, crank angles free. Move points, or solve.` : "",
      settings = { limits, top, round, unit, diverse, tolerance: { ...tolerance, rotation: null } };
    this.#take(structuredClone({ ...emptyMotion("position"), ...settings, closed, poses }), { note, fit: false });
  }

  /** Takes the motion from the page's address; false if there is none. Throws for a damaged one. */
  async openLink() {
    const { hash } = location;
    if (["#path", "#function"].includes(hash)) {
      this.begin(hash === "#path" ? "position" : "function");
      return false;
    }
    const content = await fromFragment(hash);
    if (!content || location.hash !== hash) return false;
    const { motion, card } = fromPage(content),
      how = { card, build: content.build, linked: true },
      example = this.examples.find(({ request }) => contentOf(fromRequest(request)) === contentOf(motion));
    this.asCame.add(contentOf(motion));
    if (example) this.#open(example, how);
    else this.#take(motion, { note: "Opened from a link", ...how });
    return true;
  }

  /** Takes the motion of a draft. Throws for anything else. */
  openDraft(content) {
    this.#take(fromPage(content).motion, { note: "From your draft.", mode: "move", build: content.build });
  }

  /** Return true if a motion is the user's work: it has poses, and is not an unchanged example or link. */
  isOwn(motion) {
    const { law } = motion,
      hasWork = law ? JSON.stringify(law) !== JSON.stringify(firstLaw()) : motion.poses.length > 0;
    return hasWork && !this.asCame.has(contentOf(motion));
  }

  #take(motion, { note = "", linked = false, ...how }) {
    Object.assign(this, { shown: null, linked });
    $("paste-error").textContent = "";
    $("paste-box").hidden = true;
    if (!how.table) {
      this.reading = null; // what is still being read is not wanted any more
      this.#offerColumns(null);
    }
    this.#offerAngles(motion, Boolean(how.table && !how.table.angle && looksRadian(motion)));
    this.use({ ...motion, note }, how);
  }

  /** Show the source of a motion while the motion is shown. */
  say(motion) {
    const twice = motion.note && repeated(motion),
      isEdited = this.isOwn(motion) && this.examples.some(({ title }) => motion.note?.startsWith(`${title}. `)),
      note = isEdited ? "" : motion.note, // an example's words are of its own poses and limits
      repetition = twice && `${capital(itemOf(motion))}s ${twice.join(" and ")} are the same`,
      cannot = "a crank that keeps turning cannot reach both exactly.";
    $("example-note").textContent = repetition ? `${note} ${repetition}: ${cannot}`.trim() : note;
    $("unwrap").hidden ||= !jump(motion) && !looksRadian(motion);
  }

  /** The motion whose limits hold for new rows too, the present one, but not an example that is as it came. */
  #settings() {
    const now = this.current(),
      asIs =
        this.shown && JSON.stringify(toRequest(now)) === JSON.stringify(toRequest(fromRequest(this.shown.request)));
    return asIs ? { ...emptyMotion(), unit: now.unit } : now;
  }

  /** Offers angles that jump by a whole turn without the jump, and those that look like radians in degrees. */
  #offerAngles(motion, radian) {
    const at = jump(motion);
    $("unwrap").hidden = !at && !radian;
    if ($("unwrap").hidden) return;
    const jumps = at && `The angle jumps by more than half a turn from pose ${at[0]} to ${at[1]}`;
    $("unwrap-text").textContent = radian
      ? "All angles lie within ±6.283: they look like radians, and are read as degrees."
      : `${jumps}, as if it were counted from 0 to 360°.`;
    $("unwrap-use").textContent = radian ? "Convert them to degrees" : "Unwrap them";
    $("unwrap-use").onclick = () => {
      const next = structuredClone(this.current()),
        angles = next.poses.map(({ angle }) => angle),
        degrees = (angle) => angle && Number((angle / RAD).toPrecision(12)),
        converted = radian ? angles.map(degrees) : unwrapped(angles);
      for (const [k, angle] of converted.entries()) next.poses[k].angle = angle;
      this.#take(next, { note: radian ? "Angles converted from radians." : "Angles unwrapped.", fit: false });
    };
  }

  /** The motion of a request as JSON, also as exported with its solution. Throws for anything else. */
  #fromJson(content) {
    let body;
    try {
      body = JSON.parse(content);
    } catch (error) {
      throw new Error("The file is not valid JSON.", { cause: error });
    }
    return fromRequest(body.request ?? body);
  }

  /**
   * Takes the motion in a text or a file: a request as JSON, or a table, perhaps with `columns` chosen.
   * `failed(sentence)` gets what is wrong. Only the last source that was given counts.
   */
  async #read(source, from, failed, columns = null) {
    const turn = { source, from, failed },
      isText = typeof source === "string",
      readAll = () => (isText ? source : source.text());
    this.reading = turn;
    $("paste-use").disabled = true;
    try {
      const start = isText ? source : await source.slice(0, 1000).text();
      if (start.trimStart().startsWith("{")) {
        const motion = this.#fromJson(await readAll());
        if (this.reading === turn) this.#take(motion, { note: from, mode: "move" });
        return;
      }
      const [content, thin] = (await thinned(source)) ?? [source, null],
        read = await readTable(content, "synthesize", columns);
      if (this.reading !== turn) return;
      const motion = withSamples(this.#settings(), read),
        units = Object.fromEntries(read.columns.map(({ role, unit }) => [role, unit])),
        isOffered = (remark) => !units.angle && looksRadian(motion) && remark.includes("radians"),
        notes = read.notes.filter((remark) => !isOffered(remark)).map((remark) => capital(remark.replace(/\.?$/, ".")));
      if (thin) notes.push(thin);
      if (dropClosing(motion)) notes.push("The last row repeated the first: it was dropped, and the motion is closed.");
      this.#take(motion, { note: [from, ...notes].join(" "), mode: "move", table: units });
      this.#offerColumns(read.headings, read.columns);
    } catch (error) {
      if (this.reading !== turn) return;
      if (error.ofOther) {
        const law = { ...firstLaw(), name: "pairs", table: await readAll() },
          note = `${from} Its columns are those of a function.`;
        this.#take({ ...emptyMotion("function"), unit: this.current().unit, law }, { note, mode: "move" });
        return;
      }
      failed(error.message);
      if (!columns) this.#offerColumns(error.headings ?? null); // a wrong choice of columns stays, to be corrected
    } finally {
      if (!this.reading || this.reading === turn) $("paste-use").disabled = false;
    }
  }

  /** Offers the columns of the table that was read last, of which some are `used`; hides the offer without headings. */
  #offerColumns(headings, used = []) {
    $("columns").hidden = !headings;
    if (!headings) return;
    for (const role of ROLES) {
      const select = $(`column-${role}`),
        at = used.find((column) => column.role === role)?.head;
      select.replaceChildren(new Option("–", ""), ...headings.map((head, k) => new Option(head, String(k + 1))));
      select.selectedIndex = at === undefined ? 0 : headings.indexOf(at) + 1;
    }
    $("columns").open = !used.length;
  }

  #bindColumns() {
    listen("columns-use", "click", () => {
      const chosen = ROLES.map((role) => [role, $(`column-${role}`)]).filter(([, select]) => select.value),
        values = chosen.map(([, select]) => select.value),
        repeat = values.findIndex((value, k) => values.indexOf(value) < k),
        { source, from, failed } = this.reading;
      if (repeat < 0) {
        this.#read(source, from, failed, Object.fromEntries(chosen.map(([role], k) => [role, values[k]])));
        return;
      }
      const [role, select] = chosen[repeat],
        [first] = chosen[values.indexOf(values[repeat])],
        name = `The column '${select.selectedOptions[0].text}'`;
      failed(`${name} is chosen for ${first} and for ${role}: choose a different column for each.`);
    });
  }

  #bindPaste() {
    const box = $("paste-box");
    const failed = (sentence) => {
      box.hidden = false;
      $("paste-error").textContent = sentence;
    };
    listen("paste", "click", () => {
      box.hidden = !box.hidden;
      if (!box.hidden) $("paste-text").focus();
    });
    listen("paste-text", "input", () => ($("paste-error").textContent = ""));
    listen("paste-cancel", "click", () => (box.hidden = true));
    listen("paste-use", "click", () => this.#read($("paste-text").value, "Pasted.", failed));
  }

  #bindFiles() {
    const take = (file) => {
      if (!file) return;
      const [, use] = [...FILES].find(([endings]) => endings.test(file.name)) ?? [];
      const failed = (sentence) => {
        say(sentence, true);
        $("welcome-note").textContent = sentence;
      };
      $("welcome-note").textContent = "";
      if (!use) this.#read(file, `From ${file.name}.`, (sentence) => failed(`${file.name}: ${sentence}`));
      else if (["outline", "picture"].includes(use)) {
        if (!$("welcome").hidden) this.begin("position");
        this.stage[use](file);
      } else failed(`${file.name} ${use}`);
    };
    listen("open", "click", () => $("file").click());
    listen("file", "change", () => {
      take($("file").files[0]);
      $("file").value = "";
    });
    document.addEventListener("dragover", (event) => event.preventDefault());
    document.addEventListener("drop", (event) => {
      event.preventDefault();
      take(event.dataTransfer.files[0]);
    });
  }
}
