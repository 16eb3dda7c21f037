// The form's fields for one motion: what is typed stays as it was typed, and what cannot be used is said beside it.

import { listEntries, markWrong, rangeOf, typed, unreadable, wrong } from "./decimal.js";
import { text } from "./drawing.js";
import { toRequest } from "./formats.js";
import {
  PRESET,
  clone,
  familyOf,
  itemOf,
  preferable,
  setTiming,
  scaleTravels,
  slidable,
  wantsAngles,
} from "./motion.js";
import { preferred } from "./service.js";
import { $, build, listed, listen, setAt, valueAt } from "./shell.js";
import { limitName } from "./verdict.js";

const NOTES = {
  free: (item) => `Only the ${item}s count: the search finds the crank angle at each of them.`,
  even: (item) => `The ${item}s are met at even steps of the crank.`,
  table: (item) => `Each ${item} is met at its crank angle in the table.`,
};
/** Values of the motion that a field shows and changes other than at its `data-path`, by the id of the field. */
const SPECIAL = {
  span: {
    get: (m) => Number(m.span.toPrecision(12)),
    put: (m, value) => (m.timing === "even" ? (m.span = value) : scaleTravels(m, value)),
  },
  practical: {
    get: (m) => Object.values(m.limits.kept).every(Boolean),
    put: (m, on) => Object.keys(PRESET).forEach((name) => (m.limits.kept[name] = on)),
  },
  timing: { get: (m) => m.timing, put: setTiming },
  direction: { get: (m) => String(m.direction), put: (m, value) => (m.direction = Number(value)) },
  prefer: { get: (m) => (m.law ? "error" : preferred(toRequest(m))), put: (m, value) => (m.prefer = value) },
  mechanisms: {
    get: (m) => (Array.isArray(m.mechanisms) ? "some" : m.mechanisms),
    put: (m, value) => value !== "some" && (m.mechanisms = value),
  },
  family: { get: familyOf, put: (m, value) => (m.limits.family = value) },
};
/** The box for all joints: a side without a number is as far away as FAR. */
const FAR = 1e9;
const FREE = [-FAR, -FAR, FAR, FAR];
for (const k of FREE.keys()) {
  SPECIAL[`envelope-${k}`] = {
    get: ({ limits: { extra } }) => (Math.abs(extra.envelope?.[k] ?? FAR) < FAR ? extra.envelope[k] : null),
    put({ limits: { extra } }, value) {
      const box = (extra.envelope ?? FREE).with(k, value ?? FREE[k]);
      if (box.every((bound, i) => bound === FREE[i])) delete extra.envelope;
      else extra.envelope = box;
    },
  };
}

/**
 * What a field shows of a motion and how it changes it: {id, isNumber, name, range, needed, whole, get, put}. With
 * `data-keep` it is a limit of the preset, which a value switches on and 0 for an angle switches off.
 */
function specOf(field) {
  const { id, dataset, labels, ariaLabel, required } = field,
    { path, keep, name, whole } = dataset;
  const put = (m, value) => {
    if (keep) m.limits.kept[keep] = value !== 0;
    setAt(m, path, keep ? value || null : value);
  };
  return {
    id,
    isNumber: field.matches("input:not([type=checkbox])"),
    name: name ?? ariaLabel ?? labels[0].firstChild.textContent.trim(),
    range: rangeOf(field),
    needed: required,
    whole: whole !== undefined,
    get: (m) => valueAt(m, path),
    put,
    ...SPECIAL[id],
  };
}

const BOX = [0, 1, 2, 3].map((k) => `box-${k}`);

const stockFault = ([lengths = []]) =>
  lengths.every((length) => length > 0 && length < Infinity)
    ? null
    : "Stock lengths: numbers above 0 are needed, separated by spaces.";

/** The fault of boxes, four numbers each. */
function keepOutFault(boxes) {
  const isBox = (box) => box.length === 4 && box.every(Number.isFinite) && box[0] < box[2] && box[1] < box[3],
    bad = boxes.findIndex((box) => !isBox(box)),
    rule = "needs four numbers, left, bottom, right and top, with spaces or semicolons between them";
  return bad < 0 ? null : `Keep-out boxes: line ${bad + 1} ${rule}; left is less than right, and bottom less than top.`;
}

/** Weights and tolerances that a pose may have of its own. */
const OWN = ["wr", "wp", "er", "ep"];

export class Fields {
  /** `edit(change, kind)` changes the motion; `settle()` ends a step of its history; `motion()` is the present one. */
  constructor({ edit, settle, motion }) {
    Object.assign(this, { edit, settle, motion, faults: new Map() });
    const marked = document.querySelectorAll("[data-path]");
    this.specs = [...new Set([...marked, ...Object.keys(SPECIAL).map($)])].map(specOf);
    for (const spec of this.specs) {
      const { id, isNumber, put } = spec,
        read = () => ($(id).type === "checkbox" ? $(id).checked : $(id).value);
      if (isNumber) this.#bindNumber(id, spec);
      else listen(id, "change", () => edit((m) => put(m, read()), id));
    }
    for (const id of BOX) this.#bind(id, () => this.#readBox(id));
    this.#bind("stock", () => this.#readLists("stock", stockFault, (m, [lengths = null]) => (m.stock = lengths)));
    this.#bind("keep-out", () =>
      this.#readLists("keep-out", keepOutFault, ({ limits: { extra } }, boxes) =>
        boxes.length ? (extra.keep_out = boxes) : delete extra.keep_out,
      ),
    );
    listen("box-clear", "click", () => {
      this.#clear(BOX);
      edit((m) => (m.limits.box = null));
    });
    listen("weights-clear", "click", () =>
      edit((m) => m.poses.forEach((pose) => OWN.forEach((name) => delete pose[name]))),
    );
  }

  /** The first entry that cannot be used, as [sentence, id]; null if there is none. */
  get fault() {
    for (const [id, sentence] of this.faults)
      if ($(id)?.checkVisibility?.({ visibilityProperty: true }) !== false || !$(id).closest("[hidden]"))
        return [sentence, id];
    return null;
  }

  /** Forgets entries that cannot be used: another motion is there. */
  forget() {
    this.#clear([...this.faults.keys()]);
  }

  #clear(ids) {
    for (const id of ids) {
      this.#blame(id, null);
      $(id).dataset.typed = "";
    }
  }

  /** Show the fault of a field beside it; null removes the message. */
  #blame(id, sentence) {
    const field = $(id),
      beside = BOX.includes(id) ? $("box-error") : null;
    let note = beside ?? $(`${id}-error`);
    if (!note && sentence) {
      note = build("p", { id: `${id}-error`, className: "error field-error" });
      (field.closest(".measure") ?? field.closest(".field")).after(note);
    }
    if (note) note.textContent = sentence ?? "";
    if (sentence) this.faults.set(id, sentence);
    else this.faults.delete(id);
    markWrong(field, Boolean(sentence), note?.id);
  }

  /** Reads a field at each entry that differs from the one before; leaving it ends a step of the history. */
  #bind(id, read) {
    const field = $(id);
    let before = null;
    listen(id, "input change", ({ type }) => {
      if (type === "change" && field.value === before) return;
      before = field.value;
      read();
    });
    listen(id, "blur", () => {
      this.settle();
      this.show();
    });
  }

  #bindNumber(id, spec) {
    const field = $(id);
    let before = null; // the motion before this entry, which holds until the entry is good: of 95 the 9 does not count
    field.inputMode = "decimal";
    listen(id, "focus", () => (before = clone(this.motion())));
    this.#bind(id, () => {
      const value = typed(field.value),
        fault = wrong(value, field.value, spec),
        used = before ? spec.get(before) : null;
      if (fault && before && used !== spec.get(this.motion())) this.edit((m) => Object.assign(m, clone(before)), id);
      this.#blame(id, fault && `${spec.name}: ${fault}${used === null ? "" : `; ${text(used)} is still in use`}.`);
      if (!fault) this.edit((m) => spec.put(m, value), id);
    });
  }

  /** The four fields of the pivot box are one entry: it is used once all four are there. */
  #readBox(id) {
    for (const fieldId of BOX) $(fieldId).dataset.typed = "yes";
    const entries = BOX.map((fieldId) => $(fieldId).value),
      values = entries.map(typed);
    for (const fieldId of BOX) this.#blame(fieldId, null);
    const bad = values.findIndex(Number.isNaN),
      blank = values.filter((value) => value === null).length;
    if (bad >= 0) this.#blame(BOX[bad], `Pivot box: ${unreadable(entries[bad])}.`);
    else if (blank > 0 && blank < 4) this.#blame(BOX[values.indexOf(null)], "Pivot box: all four numbers are needed.");
    else if (blank === 0 && values[0] > values[2]) this.#blame(BOX[0], "Pivot box: left must be less than right.");
    else if (blank === 0 && values[1] > values[3]) this.#blame(BOX[1], "Pivot box: bottom must be less than top.");
    else {
      for (const fieldId of BOX) $(fieldId).dataset.typed = "";
      this.edit((m) => (m.limits.box = blank ? null : values), id);
    }
  }

  /**
   * Reads a field with lines of numbers: `faultOf(lists)` returns a sentence if they cannot be used, otherwise
   * `put(motion, lists)` takes them.
   */
  #readLists(id, faultOf, put) {
    const lines = $(id)
      .value.split("\n")
      .filter((line) => line.trim());
    let lists = [],
      sentence = null;
    try {
      lists = lines.map((line) => listEntries(line).map(typed));
      sentence = faultOf(lists);
    } catch (error) {
      sentence = `${error.message}.`;
    }
    this.#blame(id, sentence);
    if (!sentence) this.edit((motion) => put(motion, lists), id);
  }

  /** Writes a value into a field that nobody types in and that holds nothing to be mended. */
  #set(id, value) {
    const field = $(id);
    if (field !== document.activeElement && !this.faults.has(id) && field.dataset.typed !== "yes")
      field.value = value ?? "";
  }

  /** Shows the motion in all fields. */
  show() {
    const motion = this.motion(),
      { limits } = motion,
      free = motion.timing === "free";
    for (const { id, isNumber, get } of this.specs)
      if (isNumber) this.#set(id, get(motion));
      else $(id)[$(id).type === "checkbox" ? "checked" : "value"] = get(motion);
    for (const [k, id] of BOX.entries()) this.#set(id, limits.box?.[k]);
    this.#set("stock", motion.stock?.join(" ") ?? "");
    this.#set("keep-out", (limits.extra.keep_out ?? []).map((box) => box.join(" ")).join("\n"));
    const { kept } = limits,
      isAnySet = Object.values(kept).some(Boolean);
    $("practical").indeterminate = isAnySet && !$("practical").checked;
    for (const [id, name] of Object.entries({ transmission: "use", "transmission-turn": "turn", ratio: "ratio" }))
      $(id).placeholder = kept[name] ? PRESET[name] : "none";
    for (const element of document.querySelectorAll("[data-timing]"))
      element.hidden = free !== (element.dataset.timing === "free");
    for (const element of document.querySelectorAll("[data-unit]")) element.textContent = motion.unit;
    $("timing-note").textContent =
      NOTES[motion.timing](itemOf(motion)) +
      (!free && !isAnySet ? " The practical limits are off, unless chosen below." : "");
    $("motion-title").textContent = wantsAngles(motion) ? "Motion" : "Path";
    for (const option of $("prefer").options) option.hidden = option.disabled = !preferable(motion, option.value);
    for (const option of $("mechanisms").options)
      option.hidden = option.disabled = option.value === "some" && !Array.isArray(motion.mechanisms);
    $("mechanisms").disabled = !slidable(motion);
    $("weights").hidden = !this.#has(...OWN);
    $("box-clear").hidden = !limits.box && !BOX.some((id) => $(id).dataset.typed);
    $("add-row").textContent = `Add a ${itemOf(motion)}`;
    $("modes").querySelector("[data-mode=add]").textContent = `Add ${itemOf(motion)}s`;
    $("studies-summary").textContent = listed(
      motion.analysis.speed !== null && "analysis",
      Object.values(motion.study).some(Number.isFinite) && "tolerances",
    );
    const others = Object.keys(limits.extra).filter((name) => !["envelope", "keep_out"].includes(name));
    $("limits-summary").textContent = others.length
      ? `Also from the request: ${others.map(limitName).join(", ")}.`
      : "";
  }

  /** Return true if a pose has a weight or tolerance of its own. */
  #has(...names) {
    return this.motion().poses.some((pose) => names.some((name) => pose[name] !== undefined));
  }
}
