// The joints of the selected linkage as numbers: each can be typed while the crank stands where it does.

import { text } from "./drawing.js";
import { markWrong, typed, unreadable } from "./decimal.js";
import { settled } from "./fit.js";
import { $ } from "./shell.js";

const SAME = 1e-9; // of the linkage's size: a field keeps its entry while the joint is there
const ROUNDING = 1e-12; // of the linkage's size: smaller differences of a joint and its entry are no change
const FARTHEST = 1e50;

const extent = ({ a, b, c }) => Math.hypot(b[0] - a[0], b[1] - a[1]) + Math.hypot(c[0] - b[0], c[1] - b[1]);

export class JointFields {
  /** `move(joint, place)` puts a joint at a place and returns null, or says why it cannot; `hold()` stops the crank. */
  constructor(board, move, hold) {
    Object.assign(this, { board, move, fields: [], faults: new Map() });
    for (const input of $("joint-fields").querySelectorAll("input")) {
      const [, name, axis] = input.id.split("-"),
        field = { input, name, k: axis === "x" ? 0 : 1, letter: `${name.toUpperCase()}, ${axis}` };
      this.fields.push(field);
      input.onfocus = () => {
        hold();
        this.#fill(field);
      };
      input.onblur = () => this.show();
      input.onchange = () => this.#read(field);
      input.onkeydown = (event) => {
        if (event.key !== "Enter") return;
        event.preventDefault();
        this.#read(field);
      };
    }
    board.seen.push(() => this.show());
  }

  /** Shows the joints where they are; an entry that stands for the same number stays as it was typed. */
  show() {
    const { joints, mode } = this.board,
      shown = mode === "hand" && Boolean(joints?.p);
    if ($("joints-panel").hidden === shown) this.#toggle(shown);
    if (shown) for (const field of this.fields) if (field.input !== document.activeElement) this.#fill(field);
  }

  /** The panel takes its room from the canvas: what was all in view stays in view. */
  #toggle(shown) {
    const { board } = this;
    $("joints-panel").hidden = !shown;
    if (board.fitted) board.fit();
  }

  /** Writes a coordinate into its field, with all digits where it is edited; an entry that stands for it stays. */
  #fill({ input, name, k, entry }) {
    const { joints } = this.board;
    if ([...this.faults.keys()].some((fault) => fault.input === input)) return;
    const size = extent(joints),
      value = settled(joints[name][k], size);
    const isCurrent = entry && Math.abs(entry.value - value) <= SAME * Math.max(size, Math.abs(value)),
      number = input === document.activeElement ? String(Number(value.toPrecision(14))) : text(value, 5),
      words = isCurrent ? entry.text : number;
    if (input.value !== words) input.value = words;
  }

  /** Entries are forgotten: another linkage is there. */
  forget() {
    for (const field of this.fields) {
      field.entry = null;
      this.#blame(field, null);
    }
    this.show();
  }

  #read(field) {
    const { input, name, k, letter } = field,
      { joints } = this.board;
    if (!joints) return;
    const value = typed(input.value);
    if (value === null || !Number.isFinite(value) || Math.abs(value) > FARTHEST) {
      this.#blame(field, `${letter}: ${unreadable(input.value)}; ${text(joints[name][k])} is still in use.`);
      return;
    }
    this.#blame(field, null);
    // leaving the field reads the same entry again
    if (Math.abs(value - joints[name][k]) <= ROUNDING * extent(joints)) return;
    const position = [...joints[name]];
    position[k] = value;
    field.entry = { value, text: input.value };
    const fault = this.move(name, position);
    if (fault) this.#blame(field, `${letter}: ${fault}`);
  }

  #blame(field, sentence) {
    if (sentence) this.faults.set(field, sentence);
    else this.faults.delete(field);
    markWrong(field.input, Boolean(sentence), "joints-error");
    $("joints-error").textContent = [...this.faults.values()][0] ?? "";
  }
}
