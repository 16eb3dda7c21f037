// The motion editor: canvas, pose table and form fields show one motion and change it, with undo and redo.

import { Board } from "./board.js";
import { pastedRows, typed, wrong } from "./decimal.js";
import { button } from "./drawing.js";
import { Fields } from "./fields.js";
import { History, emptyMotion, itemOf, nextPose, travels, wantsAngles, wantsPlaces } from "./motion.js";
import { $, build, capital, listen, rove } from "./shell.js";

const COLUMNS = { t: "crank angle", x: "x", y: "y", angle: "angle" };
const ANY = [-1e50, 1e50];
const KEYS = { ArrowUp: [-1, 0], ArrowDown: [1, 0], Enter: [1, 0] };

const cellOf = (k, name) => `pose-${k}-${name}`;
const modeButtons = () => [...document.querySelectorAll("[data-mode]:not(svg)")];

export class Editor {
  /**
   * `changed()` is called after every change of the motion, before it is drawn again; `pathDrawn(points, closed)`
   * gets a path drawn by hand, which begins a new motion; `hand` moves the joints of the selected linkage and `pivot`
   * its pivots, which undo brings back `beside` the motion. While a pointer drags, changes are drawn once a frame with
   * `changed(true)`.
   */
  constructor(changed, pathDrawn, { hand, pivot }, beside) {
    this.changed = changed;
    this.chosen = 0;
    this.cellFaults = new Map();
    this.history = new History(emptyMotion(), () => this.#soon(), beside);
    const edit = (change, kind) => this.history.change(change, kind);
    const settle = () => {
      if (this.waits) this.#soon();
      this.history.settle();
      document.dispatchEvent(new Event("settled"));
    };
    this.board = new Board($("canvas"), $("canvas-help"), {
      edit,
      settle,
      hand,
      pivot,
      choose: (k) => this.#choose(k),
      add: (at) => this.#add(at),
      remove: (k) => this.#remove(k),
      draw: pathDrawn,
    });
    this.fields = new Fields({ edit, settle, motion: () => this.motion });
    this.#bindButtons();
    this.#bindModes();
    $("poses").addEventListener("keydown", (event) => this.#walk(event));
  }

  get motion() {
    return this.history.value;
  }

  /** The first entry of table or form that cannot be used, as [sentence, id of the element]; null if there is none. */
  get fault() {
    const [first] = this.cellFaults;
    return first?.toReversed() ?? this.fields.fault;
  }

  /**
   * Puts another motion in place of this one; undo brings this one back, with what was beside it before `clear()`.
   * Without `fit` the view stays as it is.
   */
  replace(motion, fit = true, clear = () => {}) {
    this.chosen = 0;
    this.#forget();
    this.history.replace(motion, clear);
    if (fit) this.board.fit();
  }

  /** Makes the present motion the one that undo ends at. */
  forgetPast() {
    this.history.past = [];
    this.refresh();
  }

  setMode(mode) {
    this.board.setMode(mode);
    for (const modeButton of modeButtons()) {
      modeButton.setAttribute("aria-pressed", String(modeButton.dataset.mode === mode));
      modeButton.tabIndex = modeButton.dataset.mode === mode ? 0 : -1;
    }
  }

  /** Keeps the linkage as it is, before it is changed by hand, as a step of undo. */
  keep(kind) {
    this.history.keep(kind);
    this.#showSteps();
  }

  #showSteps() {
    $("undo").disabled = !this.history.past.length;
    $("redo").disabled = !this.history.future.length;
  }

  /** Draws the motion again at once; while a pointer drags, canvas and table alone, with the next frame. */
  #soon() {
    this.waits = this.board.held;
    if (!this.waits) this.refresh();
    else
      this.frame ??= requestAnimationFrame(() => {
        this.frame = null;
        if (!this.waits) return;
        this.changed(true);
        this.board.show(this.motion, this.chosen);
        if (this.motion.poses.length) this.#fillRow(this.chosen);
      });
  }

  /** Draws the motion again everywhere. */
  refresh() {
    this.#showSteps();
    this.chosen = Math.max(0, Math.min(this.chosen, this.motion.poses.length - 1));
    this.changed();
    this.board.show(this.motion, this.chosen);
    this.#showTable();
    this.fields.show();
  }

  /** Entries that could not be used belong to a motion that is gone. */
  #forget() {
    this.cellFaults.clear();
    $("table-error").textContent = "";
    this.fields.forget();
  }

  /** Shows below the table what is wrong with an entry. */
  #tell(sentence) {
    $("table-error").textContent = sentence;
    if (sentence) $("table-error").scrollIntoView({ block: "nearest" });
  }

  // -- the table --

  #showTable() {
    const { motion } = this,
      body = $("poses").tBodies[0],
      hides = {
        "no-crank": motion.timing === "free",
        "no-place": !wantsPlaces(motion),
        "no-angle": !wantsAngles(motion),
      };
    for (const [name, hidden] of Object.entries(hides)) $("poses").classList.toggle(name, hidden);
    while (body.rows.length > motion.poses.length) body.deleteRow(-1);
    while (body.rows.length < motion.poses.length) body.append(this.#makeRow(body.rows.length));
    for (const [k, angle] of travels(motion).entries()) this.#fillRow(k, angle);
    this.#markRow();
  }

  #fillRow(k, crankAngle = travels(this.motion)[k]) {
    const { motion } = this,
      { cells } = $("poses").tBodies[0].rows[k];
    for (const [column, name] of Object.keys(COLUMNS).entries()) {
      const input = cells[column + 1].firstChild,
        value = name === "t" ? crankAngle : motion.poses[k][name],
        isRequired = name === "angle" ? wantsAngles(motion) : wantsPlaces(motion),
        bad = this.cellFaults.has(cellOf(k, name));
      input.classList.toggle("invalid", bad);
      if (!bad && input !== document.activeElement) input.value = value === null ? "" : Number(value.toPrecision(6));
      input.placeholder = value === null && isRequired ? "none" : "";
      if (name === "t") input.readOnly = motion.timing !== "table" || k === 0;
      else input.disabled = !isRequired;
    }
  }

  /** Marks the row of the selected pose; only its cells are stops of the tab key, arrows lead to the others. */
  #markRow() {
    for (const [k, row] of [...$("poses").tBodies[0].rows].entries()) {
      row.className = k === this.chosen ? "chosen" : "";
      for (const cell of row.querySelectorAll("input, button")) cell.tabIndex = k === this.chosen ? 0 : -1;
    }
  }

  #makeRow(k) {
    const cells = Object.entries(COLUMNS).map(([name, label]) => this.#makeCell(k, name, label)),
      remove = button("×", () => this.#remove(k), "quiet", { "aria-label": `Remove pose ${k + 1}` });
    return build(
      "tr",
      {},
      [String(k + 1), ...cells, remove].map((content) => build("td", {}, content)),
    );
  }

  #makeCell(k, name, label) {
    const id = cellOf(k, name),
      input = build("input", { id, inputMode: "decimal", "aria-label": `Pose ${k + 1}, ${label}` });
    let before = null; // what holds until the entry is good: of 1.234,5 the 1.234 does not count
    input.onfocus = () => {
      this.#choose(k);
      before = this.motion.poses[k][name];
      // the table shows 6 digits; a number that is being edited has them all
      const value = name === "t" ? Number(travels(this.motion)[k].toPrecision(14)) : before;
      if (!this.cellFaults.has(id)) input.value = value ?? "";
    };
    input.oninput = () => {
      if (input.readOnly) return;
      // an empty cell is a place or an angle that is not asked for
      const value = typed(input.value),
        fault = wrong(value, input.value, { range: ANY, needed: name === "t" }),
        used = fault ? before : value,
        fallback = before === null ? "" : `; ${before} is still in use`;
      if (fault) this.cellFaults.set(id, `${capital(itemOf(this.motion))} ${k + 1}, ${label}: ${fault}${fallback}.`);
      else this.cellFaults.delete(id);
      input.classList.toggle("invalid", Boolean(fault));
      this.#tell([...this.cellFaults.values()][0] ?? "");
      if (fault && used === this.motion.poses[k][name]) return;
      this.history.change((motion) => {
        motion.poses[k][name] = used;
        if (name === "t" && k === motion.poses.length - 1) motion.span = used;
      }, `cell ${id}`);
    };
    input.onpaste = (event) => this.#pasteRows(event, k, name);
    input.onchange = () => {
      this.history.settle();
      this.board.reveal();
    };
    input.onblur = () => this.#showTable();
    return input;
  }

  /** Fills the table from a cell on with rows of a spreadsheet; a single number is left to the browser. */
  #pasteRows(event, first, name) {
    const content = event.clipboardData.getData("text/plain");
    const names = Object.keys(COLUMNS).filter((column) => !this.#hidden(column)),
      from = names.indexOf(name);
    if (from < 0 || !/[\t\n\r]/.test(content.trim())) return;
    event.preventDefault();
    try {
      const rows = pastedRows(content, names.length - from);
      if (name === "t" && rows.some(([value]) => value === null))
        throw new Error("Each pasted row needs a crank angle.");
      this.#forget();
      this.history.change((motion) => {
        for (const [n, row] of rows.entries()) {
          if (first + n === motion.poses.length) motion.poses.push(nextPose(motion));
          for (const [column, value] of row.entries()) motion.poses[first + n][names[from + column]] = value;
        }
        if (motion.timing === "table") motion.span = motion.poses.at(-1).t;
      });
      event.target.value = this.motion.poses[first][name] ?? "";
      this.board.reveal();
    } catch (error) {
      if (first) this.#tell(error.message);
      else this.#pasteTable(content, event.target);
    }
  }

  /** Reads a whole table, perhaps with heads, which was pasted into a cell of its first row. */
  #pasteTable(content, cell) {
    cell.blur(); // a focused cell would keep its number
    $("paste-text").value = content;
    $("paste-use").click();
  }

  /** Return true if a column of the table is hidden. */
  #hidden(name) {
    const { motion } = this;
    return name === "t" ? motion.timing !== "table" : name === "angle" ? !wantsAngles(motion) : !wantsPlaces(motion);
  }

  /** Arrows up and down, and Enter, lead from cell to cell of a column. */
  #walk(event) {
    const step = KEYS[event.key],
      cell = event.target.closest?.("td");
    if (!step || !cell || !event.target.matches("input") || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    $("poses").tBodies[0].rows[cell.parentNode.sectionRowIndex + step[0]]?.cells[cell.cellIndex].firstChild.focus();
  }

  #choose(k) {
    if (k === this.chosen) return;
    this.chosen = k;
    this.board.show(this.motion, k);
    this.#markRow();
    const box = document.querySelector(".table"),
      { offsetTop: top, offsetHeight: height } = $("poses").tBodies[0].rows[k] ?? { offsetTop: box.scrollTop + 30 };
    if (top < box.scrollTop + 30 || top + height > box.scrollTop + box.clientHeight) box.scrollTop = top - 60;
  }

  #add(at = null) {
    this.chosen = this.motion.poses.length;
    this.history.change((motion) => {
      motion.poses.push(nextPose(motion, at));
      if (motion.timing === "table") motion.span = motion.poses.at(-1).t - motion.poses[0].t || motion.span;
    });
  }

  #remove(k) {
    this.#forget();
    this.history.change((motion) => {
      motion.poses.splice(k, 1);
      if (motion.timing !== "table" || motion.poses.length < 2) return;
      const first = motion.poses[0].t;
      for (const pose of motion.poses) pose.t -= first;
      motion.span = motion.poses.at(-1).t;
    });
  }

  // -- buttons and keys --

  #step(back) {
    this.#forget();
    // a focused field would keep showing the value that is undone
    if (document.activeElement?.matches?.("input")) document.activeElement.blur();
    if (back) this.history.undo();
    else this.history.redo();
  }

  #bindButtons() {
    listen("add-row", "click", ({ detail }) => {
      this.#add();
      this.board.reveal();
      if (!detail) this.board.poses.focus(-1); // pressed by a key: arrows move it
    });
    listen("undo", "click", () => this.#step(true));
    listen("redo", "click", () => this.#step(false));
    document.addEventListener("keydown", (event) => {
      if (!(event.ctrlKey || event.metaKey) || event.altKey || event.target.matches?.("textarea")) return;
      const key = event.key.toLowerCase();
      if (key !== "z" && key !== "y") return;
      event.preventDefault();
      this.#step(key === "z" && !event.shiftKey);
    });
    listen("fit", "click", () => this.board.fit());
    listen("zoom-in", "click", () => this.board.zoom(1.3));
    listen("zoom-out", "click", () => this.board.zoom(1 / 1.3));
  }

  /** The modes are one stop of the tab key; arrows choose among them. */
  #bindModes() {
    for (const modeButton of modeButtons())
      modeButton.addEventListener("click", () => this.setMode(modeButton.dataset.mode));
    rove("modes", modeButtons, (next) => this.setMode(next.dataset.mode));
  }
}
