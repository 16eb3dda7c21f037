// The motion editor: canvas, pose table and form fields show one motion and change it, with undo and redo.

import { Board } from "./board.js";
import { text } from "./drawing.js";
import { History, emptyMotion, nextPose, scaleTravels, setTiming, travels, wantsAngles, wantsPlaces } from "./motion.js";
import { $ } from "./shell.js";

const COLUMNS = [["t", "crank angle"], ["x", "x"], ["y", "y"], ["angle", "angle"]];

const NOTES = {
  free: (item) => `Only the ${item}s count: the search finds the crank angle at each of them.`,
  even: (item) => `The ${item}s are met at even steps of the crank.`,
  table: (item) => `Each ${item} is met at its crank angle in the table.`,
};

const modeButtons = () => document.querySelectorAll("[data-mode]:not(svg)");

/** Leaves the element alone while the user types in it. */
function set(element, value) {
  if (element !== document.activeElement) element.value = value ?? "";
}

export class Editor {
  /**
   * `changed()` is called after every change of the motion, before it is drawn again; `drawn(places, closed)` gets a path drawn
   * by hand, which begins a new motion.
   */
  constructor(changed, drawn) {
    this.changed = changed;
    this.chosen = 0;
    this.history = new History(emptyMotion(), () => this.refresh());
    this.board = new Board($("canvas"), $("canvas-help"), {
      edit: (change, kind) => this.history.change((motion) => { change(motion); }, kind),
      settle: () => this.history.settle(),
      choose: (k) => this.#choose(k),
      add: (at) => this.#add(at),
      remove: (k) => this.#remove(k),
      draw: drawn,
    });
    this.#bindFields();
    this.#bindButtons();
  }

  get motion() { return this.history.value; }

  /** Puts another motion in place of this one; undo brings this one back. `fit` false leaves the view as it is. */
  replace(motion, fit = true) {
    this.chosen = 0;
    this.history.change(() => motion);
    if (fit) this.board.fit();
  }

  /** Makes the present motion the one that undo ends at. */
  forgetPast() {
    this.history.past = [];
    this.refresh();
  }

  setMode(mode) {
    this.board.setMode(mode);
    for (const button of modeButtons()) button.setAttribute("aria-pressed", String(button.dataset.mode === mode));
  }

  /** Draws the motion again everywhere. */
  refresh() {
    $("undo").disabled = !this.history.past.length;
    $("redo").disabled = !this.history.future.length;
    this.chosen = Math.max(0, Math.min(this.chosen, this.motion.poses.length - 1));
    this.changed();
    this.board.show(this.motion, this.chosen);
    this.#showTable();
    this.#showFields();
  }

  #showFields() {
    const { motion } = this, { limits, tolerance } = motion, free = motion.timing === "free";
    set($("timing"), motion.timing);
    for (const element of document.querySelectorAll("[data-timing]")) element.hidden = free !== (element.dataset.timing === "free");
    $("timing-note").textContent = NOTES[motion.timing](wantsAngles(motion) ? "pose" : "point");
    set($("span"), Number(motion.span.toPrecision(12)));
    set($("direction"), String(motion.direction));
    $("any-order").checked = motion.anyOrder;
    $("closed").checked = motion.closed;
    set($("span-max"), motion.spanMax);
    set($("tolerance-rotation"), tolerance.rotation);
    set($("tolerance-position"), tolerance.position);
    set($("wanted"), motion.wanted);
    set($("family"), limits.family);
    set($("transmission"), limits.transmission || "");
    $("practical").checked = limits.practical;
    $("transmission").placeholder = limits.practical ? "35" : "0";
    set($("link-min"), limits.min);
    set($("link-max"), limits.max);
    set($("round"), motion.round);
    set($("stock"), motion.stock?.join(" ") ?? "");
    set($("speed-of-crank"), motion.analysis.speed);
    for (const [k, axis] of ["x", "y"].entries()) set($(`force-${axis}`), motion.analysis.force[k]);
    set($("torque"), motion.analysis.torque);
    for (const name of ["links", "pivots", "clearance"]) set($(`study-${name}`), motion.study[name]);
    $("studies-summary").textContent = [motion.analysis.speed === null ? "" : "analysis", Object.values(motion.study).some(Number.isFinite) ? "tolerances" : ""].filter(Boolean).join(", ");
    set($("top"), motion.top);
    for (let k = 0; k < 4; k++) set($(`box-${k}`), limits.box?.[k]);
    const active = [];
    if (limits.practical) active.push("practical");
    if (limits.family !== "full_crank") active.push($("family").selectedOptions[0]?.textContent);
    if (limits.transmission) active.push(`transmission ≥ ${text(limits.transmission, 3)}°`);
    if (limits.min || limits.max) active.push("link lengths");
    if (limits.box) active.push("pivot box");
    if (motion.round) active.push(`rounded to ${text(motion.round)}`);
    else if (motion.stock?.length) active.push("stock lengths");
    if (tolerance.rotation || tolerance.position || this.#has("er", "ep")) active.push("tolerances");
    $("weights").hidden = !this.#has("wr", "wp", "er", "ep");
    $("limits-summary").textContent = active.join(", ") || "crank turns fully";
    $("box-clear").hidden = !limits.box;
    $("add-row").textContent = wantsAngles(motion) ? "Add a pose" : "Add a point";
  }

  /** Whether some pose has a weight or tolerance of its own. */
  #has(...names) { return this.motion.poses.some((pose) => names.some((name) => pose[name] !== undefined)); }

  #showTable() {
    const { motion } = this, body = $("poses").tBodies[0], angles = travels(motion);
    const hides = { "no-crank": motion.timing === "free", "no-place": !wantsPlaces(motion), "no-angle": !wantsAngles(motion) };
    for (const [name, hidden] of Object.entries(hides)) $("poses").classList.toggle(name, hidden);
    while (body.rows.length > motion.poses.length) body.deleteRow(-1);
    while (body.rows.length < motion.poses.length) body.append(this.#makeRow(body.rows.length));
    motion.poses.forEach((pose, k) => {
      const row = body.rows[k];
      row.className = k === this.chosen ? "chosen" : "";
      COLUMNS.forEach(([name], column) => {
        const input = row.cells[column + 1].firstChild;
        const value = name === "t" ? angles[k] : pose[name];
        const asked = name === "angle" ? wantsAngles(motion) : wantsPlaces(motion);
        set(input, value === null ? "" : Number(value.toPrecision(6)));
        input.placeholder = value === null && asked ? "none" : "";
        if (name === "t") input.readOnly = motion.timing !== "table" || k === 0;
        else input.disabled = !asked;
      });
    });
  }

  #makeRow(k) {
    const row = document.createElement("tr");
    row.insertCell().textContent = String(k + 1);
    for (const [name, label] of COLUMNS) row.insertCell().append(this.#makeCell(k, name, label));
    const remove = document.createElement("button");
    remove.type = "button";
    remove.className = "quiet";
    remove.textContent = "×";
    remove.setAttribute("aria-label", `Remove pose ${k + 1}`);
    remove.addEventListener("click", () => this.#remove(k));
    row.insertCell().append(remove);
    return row;
  }

  #makeCell(k, name, label) {
    const input = document.createElement("input");
    input.type = "text";
    input.inputMode = "decimal";
    input.setAttribute("aria-label", `Pose ${k + 1}, ${label}`);
    input.addEventListener("focus", () => {
      this.#choose(k);
      // the table shows 6 digits; a number that is being edited has them all
      input.value = name === "t" ? Number(travels(this.motion)[k].toPrecision(14)) : this.motion.poses[k][name];
    });
    input.addEventListener("input", () => {
      // an empty cell is a place or an angle that is not asked for
      const blank = input.value.trim() === "", value = blank ? null : Number(input.value.replace(",", "."));
      const good = blank ? name !== "t" : Number.isFinite(value);
      input.classList.toggle("invalid", !good);
      if (good && !input.readOnly) this.history.change((motion) => {
        motion.poses[k][name] = value;
        if (name === "t" && k === motion.poses.length - 1) motion.span = value;
      }, `cell ${k} ${name}`);
    });
    input.addEventListener("change", () => { this.history.settle(); input.classList.remove("invalid"); });
    input.addEventListener("blur", () => this.#showTable());
    return input;
  }

  #choose(k) {
    if (k === this.chosen) return;
    this.chosen = k;
    this.board.show(this.motion, k);
    const rows = $("poses").tBodies[0].rows;
    for (const [j, row] of [...rows].entries()) row.className = j === k ? "chosen" : "";
    const box = document.querySelector(".table"), row = rows[k];
    if (row && (row.offsetTop < box.scrollTop + 30 || row.offsetTop + row.offsetHeight > box.scrollTop + box.clientHeight)) box.scrollTop = row.offsetTop - 60;
  }

  #add(at = null) {
    this.chosen = this.motion.poses.length;
    this.history.change((motion) => {
      motion.poses.push(nextPose(motion, at));
      if (motion.timing === "table") motion.span = motion.poses.at(-1).t - motion.poses[0].t || motion.span;
    });
  }

  #remove(k) {
    this.history.change((motion) => {
      motion.poses.splice(k, 1);
      if (motion.timing === "table" && motion.poses.length > 1) {
        const first = motion.poses[0].t;
        motion.poses.forEach((pose) => { pose.t -= first; });
        motion.span = motion.poses.at(-1).t;
      }
    });
  }

  /** Lets a form field change the motion: `change(motion, value)`, the value of an empty number field is null. */
  #bind(id, change) {
    const element = $(id), numeric = element.type === "number";
    element.addEventListener(element.tagName === "SELECT" || element.type === "checkbox" ? "change" : "input", () => {
      if (element.type === "checkbox") {
        this.history.change((motion) => { change(motion, element.checked); }, id);
        return;
      }
      const entered = element.value.trim();
      if (numeric && entered !== "" && !element.checkValidity()) return;
      const value = !numeric ? entered : entered === "" ? null : Number(entered);
      this.history.change((motion) => { change(motion, value); }, id);
    });
    element.addEventListener("blur", () => { this.history.settle(); this.#showFields(); });
  }

  #bindFields() {
    this.#bind("span", (motion, value) => {
      if (!value) return;
      if (motion.timing === "even") motion.span = value;
      else scaleTravels(motion, value);
    });
    this.#bind("direction", (motion, value) => { motion.direction = Number(value); });
    this.#bind("timing", setTiming);
    this.#bind("any-order", (motion, value) => { motion.anyOrder = value; });
    this.#bind("closed", (motion, value) => { motion.closed = value; });
    this.#bind("span-max", (motion, value) => { motion.spanMax = value; });
    this.#bind("tolerance-rotation", (motion, value) => { motion.tolerance.rotation = value; });
    this.#bind("tolerance-position", (motion, value) => { motion.tolerance.position = value; });
    $("weights-clear").addEventListener("click", () => this.history.change((motion) => {
      for (const pose of motion.poses) for (const name of ["wr", "wp", "er", "ep"]) delete pose[name];
    }));
    this.#bind("wanted", (motion, value) => { motion.wanted = value; });
    this.#bind("practical", (motion, value) => { motion.limits.practical = value; });
    this.#bind("family", (motion, value) => { motion.limits.family = value; });
    this.#bind("transmission", (motion, value) => { motion.limits.transmission = value ?? 0; });
    this.#bind("link-min", (motion, value) => { motion.limits.min = value; });
    this.#bind("link-max", (motion, value) => { motion.limits.max = value; });
    this.#bind("round", (motion, value) => { motion.round = value; });
    this.#bind("stock", (motion, value) => {
      const lengths = value.split(/[\s;]+/).filter(Boolean).map((one) => Number(one.replace(",", ".")));
      const good = lengths.every((length) => length > 0 && Number.isFinite(length));
      $("stock").classList.toggle("invalid", !good);
      if (good) motion.stock = lengths.length ? lengths : null;
    });
    this.#bind("speed-of-crank", (motion, value) => { motion.analysis.speed = value; });
    for (const [k, axis] of ["x", "y"].entries()) this.#bind(`force-${axis}`, (motion, value) => { motion.analysis.force[k] = value; });
    this.#bind("torque", (motion, value) => { motion.analysis.torque = value; });
    for (const name of ["links", "pivots", "clearance"]) this.#bind(`study-${name}`, (motion, value) => { motion.study[name] = value; });
    this.#bind("top", (motion, value) => { if (value) motion.top = value; });
    for (let k = 0; k < 4; k++) {
      this.#bind(`box-${k}`, (motion) => {
        const box = [0, 1, 2, 3].map((j) => ($(`box-${j}`).value === "" ? NaN : Number($(`box-${j}`).value)));
        if (box.every(Number.isFinite)) motion.limits.box = box;
        else if (box.every(Number.isNaN)) motion.limits.box = null;
      });
    }
    $("box-clear").addEventListener("click", () => this.history.change((motion) => { motion.limits.box = null; }));
  }

  #bindButtons() {
    $("add-row").addEventListener("click", () => this.#add());
    $("undo").addEventListener("click", () => this.history.undo());
    $("redo").addEventListener("click", () => this.history.redo());
    document.addEventListener("keydown", (event) => {
      if (!(event.ctrlKey || event.metaKey) || event.altKey || event.target.matches?.("textarea")) return;
      const key = event.key.toLowerCase();
      if (key !== "z" && key !== "y") return;
      event.preventDefault();
      // a focused field would keep showing the value that is undone
      if (document.activeElement?.matches?.("input")) document.activeElement.blur();
      if (key === "y" || event.shiftKey) this.history.redo();
      else this.history.undo();
    });
    for (const button of modeButtons()) button.addEventListener("click", () => this.setMode(button.dataset.mode));
    $("fit").addEventListener("click", () => this.board.fit());
    $("zoom-in").addEventListener("click", () => this.board.zoom(1.3));
    $("zoom-out").addEventListener("click", () => this.board.zoom(1 / 1.3));
  }
}
