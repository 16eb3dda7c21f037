// The form's fields for one motion: what is typed stays as it was typed, and what cannot be used is said beside it.

import { markWrong, typed, unreadable, wrong } from "./decimal.js";
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
import { $ } from "./shell.js";
import { limitName } from "./verdict.js";

const NOTES = {
  free: (item) => `Only the ${item}s count: the search finds the crank angle at each of them.`,
  even: (item) => `The ${item}s are met at even steps of the crank.`,
  table: (item) => `Each ${item} is met at its crank angle in the table.`,
};
const ANY = [-1e50, 1e50],
  ABOVE = [Number.MIN_VALUE, 1e50],
  WITHIN = [0, 1e50];

/**
 * Fields of numbers by id: [range of what is allowed, value of the motion, change of the motion, name in sentences]. An empty field
 * is null; `needed` ones may not be empty.
 */
const NUMBERS = {
  span: {
    range: [0.1, 3600],
    name: "Crank span",
    needed: true,
    get: (m) => Number(m.span.toPrecision(12)),
    put: (m, value) => (m.timing === "even" ? (m.span = value) : scaleTravels(m, value)),
  },
  "span-max": {
    range: [0.1, 3600],
    name: "Crank turns at most",
    get: (m) => m.spanMax,
    put: (m, value) => {
      m.spanMax = value;
    },
  },
  "start-angle": {
    range: [-360, 360],
    name: "Crank begins at",
    get: (m) => m.startAngle,
    put: (m, value) => {
      m.startAngle = value;
    },
  },
  transmission: {
    range: [0, 89.9],
    name: "Transmission angle in use",
    get: (m) => m.limits.transmission,
    put: (m, value) => keep(m.limits, "use", "transmission", value),
  },
  "transmission-turn": {
    range: [0, 89.9],
    name: "Transmission angle over the turn",
    get: (m) => m.limits.turn,
    put: (m, value) => keep(m.limits, "turn", "turn", value),
  },
  ratio: {
    range: [1, 1e6],
    name: "Longest link",
    get: (m) => m.limits.ratio,
    put: (m, value) => keep(m.limits, "ratio", "ratio", value),
  },
  "link-min": {
    range: ABOVE,
    name: "Links at least",
    get: (m) => m.limits.min,
    put: (m, value) => {
      m.limits.min = value;
    },
  },
  "link-max": {
    range: ABOVE,
    name: "Links at most",
    get: (m) => m.limits.max,
    put: (m, value) => {
      m.limits.max = value;
    },
  },
  "tolerance-rotation": {
    range: ABOVE,
    name: "Angle error allowed",
    get: (m) => m.tolerance.rotation,
    put: (m, value) => {
      m.tolerance.rotation = value;
    },
  },
  "tolerance-position": {
    range: ABOVE,
    name: "Position error allowed",
    get: (m) => m.tolerance.position,
    put: (m, value) => {
      m.tolerance.position = value;
    },
  },
  round: {
    range: ABOVE,
    name: "Round links to",
    get: (m) => m.round,
    put: (m, value) => {
      m.round = value;
    },
  },
  top: {
    range: [1, 100],
    whole: true,
    needed: true,
    name: "Solutions",
    get: (m) => m.top,
    put: (m, value) => {
      m.top = value;
    },
  },
  "speed-of-crank": {
    range: ANY,
    name: "Crank speed",
    get: (m) => m.analysis.speed,
    put: (m, value) => {
      m.analysis.speed = value;
    },
  },
  "force-x": {
    range: ANY,
    name: "Force, x",
    get: (m) => m.analysis.force[0],
    put: (m, value) => {
      m.analysis.force[0] = value;
    },
  },
  "force-y": {
    range: ANY,
    name: "Force, y",
    get: (m) => m.analysis.force[1],
    put: (m, value) => {
      m.analysis.force[1] = value;
    },
  },
  torque: {
    range: ANY,
    name: "Torque",
    get: (m) => m.analysis.torque,
    put: (m, value) => {
      m.analysis.torque = value;
    },
  },
  "study-links": {
    range: WITHIN,
    name: "Lengths within",
    get: (m) => m.study.links,
    put: (m, value) => {
      m.study.links = value;
    },
  },
  "study-pivots": {
    range: WITHIN,
    name: "Pivots within",
    get: (m) => m.study.pivots,
    put: (m, value) => {
      m.study.pivots = value;
    },
  },
  "study-clearance": {
    range: WITHIN,
    name: "Clearance",
    get: (m) => m.study.clearance,
    put: (m, value) => {
      m.study.clearance = value;
    },
  },
};
/** The box for all joints: a side without a number is as far away as FAR. */
const FAR = 1e9,
  SIDES = ["left", "bottom", "right", "top"],
  FREE = [-FAR, -FAR, FAR, FAR];
for (const [k, side] of SIDES.entries()) {
  NUMBERS[`envelope-${k}`] = {
    range: ANY,
    name: `Room for all joints, ${side}`,
    get: ({ limits: { extra } }) => (Math.abs(extra.envelope?.[k] ?? FAR) < FAR ? extra.envelope[k] : null),
    put: ({ limits: { extra } }, value) => {
      const box = (extra.envelope ?? FREE).with(k, value ?? FREE[k]);
      if (box.every((one, i) => one === FREE[i])) delete extra.envelope;
      else extra.envelope = box;
    },
  };
}
const CHECKS = {
  "any-order": [
    (m) => m.anyOrder,
    (m, on) => {
      m.anyOrder = on;
    },
  ],
  closed: [
    (m) => m.closed,
    (m, on) => {
      m.closed = on;
    },
  ],
  diverse: [
    (m) => m.diverse,
    (m, on) => {
      m.diverse = on;
    },
  ],
  practical: [
    (m) => Object.values(m.limits.kept).every(Boolean),
    (m, on) => {
      for (const name of Object.keys(PRESET)) m.limits.kept[name] = on;
    },
  ],
  ...Object.fromEntries(
    Object.keys(PRESET).map((name) => [
      `keep-${name}`,
      [
        (m) => m.limits.kept[name],
        (m, on) => {
          m.limits.kept[name] = on;
        },
      ],
    ]),
  ),
};
const CHOICES = {
  timing: [(m) => m.timing, setTiming],
  direction: [
    (m) => String(m.direction),
    (m, value) => {
      m.direction = Number(value);
    },
  ],
  wanted: [
    (m) => m.wanted,
    (m, value) => {
      m.wanted = value;
    },
  ],
  prefer: [
    (m) => preferred(toRequest(m)),
    (m, value) => {
      m.prefer = value;
    },
  ],
  mechanisms: [
    (m) => (Array.isArray(m.mechanisms) ? "some" : m.mechanisms),
    (m, value) => {
      if (value !== "some") m.mechanisms = value;
    },
  ],
  family: [
    familyOf,
    (m, value) => {
      m.limits.family = value;
    },
  ],
  "length-unit": [
    (m) => m.unit,
    (m, value) => {
      m.unit = value;
    },
  ],
};
const BOX = [0, 1, 2, 3].map((k) => `box-${k}`);

/** A limit of the preset gets a value of its own; that it is typed switches it on, and 0 for an angle switches it off. */
function keep(limits, name, own, value) {
  limits.kept[name] = value !== 0;
  limits[own] = value || null;
}

/** Calls `read` when the entry of a field is another one, typed or cleared. */
function onEntry(field, read) {
  let before = null;
  for (const name of ["input", "change"])
    field.addEventListener(name, () => {
      if (name === "input" || field.value !== before) {
        before = field.value;
        read();
      }
    });
}

export class Fields {
  /** `edit(change, kind)` changes the motion; `settle()` ends a step of its history; `motion()` is the present one. */
  constructor({ edit, settle, motion }) {
    Object.assign(this, { edit, settle, motion, faults: new Map() });
    for (const [id, spec] of Object.entries(NUMBERS)) this.#bindNumber(id, spec);
    for (const [id, [, put]] of Object.entries(CHECKS))
      $(id).addEventListener("change", () =>
        this.edit((m) => {
          put(m, $(id).checked);
        }, id),
      );
    for (const [id, [, put]] of Object.entries(CHOICES))
      $(id).addEventListener("change", () =>
        this.edit((m) => {
          put(m, $(id).value);
        }, id),
      );
    for (const id of BOX) this.#bindBox(id);
    this.#bindStock();
    this.#bindKeepOut();
    $("box-clear").addEventListener("click", () => {
      this.#clear(BOX);
      this.edit((m) => {
        m.limits.box = null;
      });
    });
    $("weights-clear").addEventListener("click", () =>
      this.edit((m) => {
        for (const pose of m.poses) for (const name of ["wr", "wp", "er", "ep"]) delete pose[name];
      }),
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

  /** Says beside a field what is wrong with it; null takes that back. */
  #blame(id, sentence) {
    const field = $(id),
      beside = BOX.includes(id) ? $("box-error") : null;
    let note = beside ?? $(`${id}-error`);
    if (!note && sentence) {
      note = Object.assign(document.createElement("p"), { id: `${id}-error`, className: "error field-error" });
      (field.closest(".measure") ?? field.closest(".field")).after(note);
    }
    if (note) note.textContent = sentence ?? "";
    if (sentence) this.faults.set(id, sentence);
    else this.faults.delete(id);
    markWrong(field, Boolean(sentence), note?.id);
  }

  #bindNumber(id, spec) {
    const field = $(id);
    let before = null; // the motion before this entry, which holds until the entry is good: of 95 the 9 does not count
    field.inputMode = "decimal";
    field.addEventListener("focus", () => {
      before = clone(this.motion());
    });
    onEntry(field, () => {
      const value = typed(field.value),
        fault = wrong(value, field.value, spec),
        used = before ? spec.get(before) : null;
      if (fault && before && used !== spec.get(this.motion()))
        this.edit((m) => {
          Object.assign(m, clone(before));
        }, id);
      this.#blame(id, fault && `${spec.name}: ${fault}${used === null ? "" : `; ${text(used)} is still in use`}.`);
      if (!fault)
        this.edit((m) => {
          spec.put(m, value);
        }, id);
    });
    field.addEventListener("blur", () => {
      this.settle();
      this.show();
    });
  }

  /** The four fields of the pivot box are one entry: it is used once all four are there. */
  #bindBox(id) {
    $(id).inputMode = "decimal";
    onEntry($(id), () => this.#readBox(id));
    $(id).addEventListener("blur", () => {
      this.settle();
      this.show();
    });
  }

  #readBox(id) {
    for (const one of BOX) $(one).dataset.typed = "yes";
    const entries = BOX.map((one) => $(one).value),
      values = entries.map(typed);
    this.#clearFaults();
    const bad = values.findIndex(Number.isNaN),
      blank = values.filter((value) => value === null).length;
    if (bad >= 0) this.#blame(BOX[bad], `Pivot box: ${unreadable(entries[bad])}.`);
    else if (blank > 0 && blank < 4) this.#blame(BOX[values.indexOf(null)], "Pivot box: all four numbers are needed.");
    else if (blank === 0 && values[0] > values[2]) this.#blame(BOX[0], "Pivot box: left must be less than right.");
    else if (blank === 0 && values[1] > values[3]) this.#blame(BOX[1], "Pivot box: bottom must be less than top.");
    else {
      for (const one of BOX) $(one).dataset.typed = "";
      this.edit((m) => {
        m.limits.box = blank ? null : values;
      }, id);
    }
  }

  #clearFaults() {
    for (const one of BOX) this.#blame(one, null);
  }

  #bindStock() {
    const field = $("stock");
    onEntry(field, () => {
      const lengths = field.value
        .split(/[\s;]/.test(field.value.trim()) ? /,?\s+|,$|;/ : ",")
        .filter(Boolean)
        .map((one) => [one, typed(one)]);
      const bad = lengths.find(([, length]) => !(length > 0 && Number.isFinite(length)));
      this.#blame(
        "stock",
        bad ? `Stock lengths: ${Number.isNaN(bad[1]) ? unreadable(bad[0]) : `“${bad[0]}” is not a length`}.` : null,
      );
      if (!bad)
        this.edit((m) => {
          m.stock = lengths.length ? lengths.map(([, length]) => length) : null;
        }, "stock");
    });
    field.addEventListener("blur", () => {
      this.settle();
      this.show();
    });
  }

  /** A box a line, four numbers each. */
  #bindKeepOut() {
    const field = $("keep-out");
    onEntry(field, () => {
      const boxes = field.value
        .split("\n")
        .filter((line) => line.trim())
        .map((line) =>
          line
            .split(/\s*[;\t ]\s*|,\s+|,(?=-)/)
            .filter(Boolean)
            .map(typed),
        );
      const bad = boxes.findIndex(
        (box) => box.length !== 4 || !box.every(Number.isFinite) || box[0] >= box[2] || box[1] >= box[3],
      );
      this.#blame(
        "keep-out",
        bad < 0
          ? null
          : `Keep-out boxes: line ${bad + 1} needs four numbers, left, bottom, right and top, with spaces or semicolons between them; left is less than right, and bottom less than top.`,
      );
      if (bad < 0)
        this.edit((m) => {
          if (boxes.length) m.limits.extra.keep_out = boxes;
          else delete m.limits.extra.keep_out;
        }, "keep-out");
    });
    field.addEventListener("blur", () => {
      this.settle();
      this.show();
    });
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
    for (const [id, { get }] of Object.entries(NUMBERS)) this.#set(id, get(motion));
    for (const [id, [get]] of Object.entries(CHECKS)) $(id).checked = get(motion);
    for (const [id, [get]] of Object.entries(CHOICES)) $(id).value = get(motion);
    for (const [k, id] of BOX.entries()) this.#set(id, limits.box?.[k]);
    this.#set("stock", motion.stock?.join(" ") ?? "");
    this.#set("keep-out", (limits.extra.keep_out ?? []).map((box) => box.join(" ")).join("\n"));
    const { kept } = limits,
      some = Object.values(kept).some(Boolean);
    $("practical").indeterminate = some && !$("practical").checked;
    for (const [name, id] of [
      ["use", "transmission"],
      ["turn", "transmission-turn"],
      ["ratio", "ratio"],
    ])
      $(id).placeholder = kept[name] ? PRESET[name] : "none";
    for (const element of document.querySelectorAll("[data-timing]"))
      element.hidden = free !== (element.dataset.timing === "free");
    for (const element of document.querySelectorAll("[data-unit]")) element.textContent = motion.unit;
    $("timing-note").textContent =
      NOTES[motion.timing](itemOf(motion)) +
      (!free && !some ? " The practical limits are off, unless chosen below." : "");
    $("motion-title").textContent = wantsAngles(motion) ? "Motion" : "Path";
    for (const option of $("prefer").options) option.hidden = option.disabled = !preferable(motion, option.value);
    for (const option of $("mechanisms").options)
      option.hidden = option.disabled = option.value === "some" && !Array.isArray(motion.mechanisms);
    $("mechanisms").disabled = !slidable(motion);
    $("weights").hidden = !this.#has("wr", "wp", "er", "ep");
    $("box-clear").hidden = !limits.box && !BOX.some((id) => $(id).dataset.typed);
    $("add-row").textContent = `Add a ${itemOf(motion)}`;
    $("modes").querySelector("[data-mode=add]").textContent = `Add ${itemOf(motion)}s`;
    $("studies-summary").textContent = [
      motion.analysis.speed === null ? "" : "analysis",
      Object.values(motion.study).some(Number.isFinite) ? "tolerances" : "",
    ]
      .filter(Boolean)
      .join(", ");
    $("limits-summary").textContent = this.#summary(motion).join(", ");
  }

  #summary({ limits, round, stock, tolerance, unit, prefer, mechanisms }) {
    const { kept } = limits,
      all = Object.values(kept).every(Boolean),
      none = !Object.values(kept).some(Boolean);
    const found = [all ? "practical" : none ? "none practical" : "some practical"];
    if (!["auto", "four_bar"].includes(mechanisms) && slidable(this.motion()))
      found.push($("mechanisms").selectedOptions[0]?.textContent);
    if (limits.family) found.push($("family").selectedOptions[0]?.textContent);
    if (limits.transmission) found.push(`transmission ≥ ${text(limits.transmission, 3)}°`);
    if (limits.min || limits.max)
      found.push(
        `links ${[limits.min && `≥ ${text(limits.min, 4)}`, limits.max && `≤ ${text(limits.max, 4)}`].filter(Boolean).join(" and ")} ${unit}`,
      );
    if (limits.box) found.push("pivot box");
    found.push(...Object.keys(limits.extra).map(limitName)); // some of them come from a file or a link and have no fields
    if (round) found.push(`rounded to ${text(round)} ${unit}`);
    else if (stock?.length) found.push("stock lengths");
    if (tolerance.rotation || tolerance.position || this.#has("er", "ep")) found.push("tolerances");
    if (prefer) found.push($("prefer").selectedOptions[0]?.textContent);
    return found;
  }

  /** Whether some pose has a weight or tolerance of its own. */
  #has(...names) {
    return this.motion().poses.some((pose) => names.some((name) => pose[name] !== undefined));
  }
}
