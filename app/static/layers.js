// Layers of the plates of a linkage: asked for after an answer, plates and collisions on the canvas.

import { numberIn } from "./decimal.js";
import { button, element, make, text } from "./drawing.js";
import { fitOf } from "./fit.js";
import { unitOf } from "./motion.js";
import { RAD, add, turned } from "./plane.js";
import { ask } from "./service.js";
import { $, capital, listen } from "./shell.js";
import { drawStack } from "./stack.js";
import { driveTurns } from "./timing.js";
import { layersOf } from "./verdict.js";

const FIRST = 10; // solutions of an answer whose layers are asked for without being selected
const MOST_CORNERS = 200;
const EDGE = 1.5;
const CLICK_MS = 300;
const SIZES = ["hole", "width", "thickness", "clearance", "kerf", "scale"]; // part settings, for layers and every file
const SETTINGS = ["boards", "heads", "body", ...SIZES].map((name) => `layer-${name}`);
const AGAIN = "Searching for layers again. The layers shown belong to the linkage before it was moved.";

/** The longest closed line of an outline as corners, thinned out where it has too many; null where none is closed. */
function polygonOf(outline) {
  const isClosed = (line) => line.length > 3 && line[0].every((value, i) => value === line.at(-1)[i]),
    [longest] = (outline ?? []).filter(isClosed).sort((a, b) => b.length - a.length);
  if (!longest) return null;
  const step = Math.ceil((longest.length - 1) / MOST_CORNERS);
  return longest.slice(0, -1).filter((_, k) => k % step === 0);
}

/** The body's corners as the service takes them: without a wanted rotation in the axes of the first sample. */
function bodyOf(outline, solution, motion) {
  const corners = polygonOf(outline);
  if (!corners || !solution.mount || solution.body_offset !== null) return corners;
  const turn = fitOf(solution, motion).linkage.at(0)?.coupler ?? 0;
  return corners.map((corner) => turned(corner, turn));
}

/** A sentence with four digits in each of its decimal numbers. */
const rounded = (sentence) => sentence.replaceAll(/\d+\.\d+/g, (value) => text(Number(value), 4));

/** Return true if a drive position lies within a collision, also if the collision spans the seam of a turn. */
function within({ from, to }, position, turns) {
  const spare = 1e-5 * (1 + Math.abs(position)); // reasons name positions with six digits
  return (turns ? [-360, 0, 360] : [0]).some(
    (turn) => from - spare <= position + turn && position + turn <= to + spare,
  );
}

/** Takes the assembly from a verdict. */
function forget(solution) {
  const { assembly: _gone, reasons = [], ...remaining } = solution.verdict,
    otherReasons = reasons.filter((reason) => !reason.startsWith("layers:"));
  solution.verdict = { ...remaining, practical_without_collisions: null, reasons: otherReasons };
}

/** Return the description of an assembly, as a sentence. */
function sentenceOf({ status, count, exhaustive, smallest_gap: gap, sizes }, unit) {
  const state = {
    free: `Nothing collides in ${layersOf(count)}`,
    touching: `In ${layersOf(count)} parts may just touch`,
    blocked: exhaustive
      ? "Cannot be built: parts collide in every order of the allowed number of layers"
      : "Parts collide in every order of layers that was tried",
  }[status];
  const room = gap ? `; smallest gap ${text(gap.value, 4)} ${unit} beyond the clearance` : "",
    list = ["hole", "width", "thickness"].map((name) => `${name === "hole" ? "holes" : name} ${text(sizes[name], 4)}`);
  return `${state}${room}; ${list.join(", ")} ${unit}.`;
}

/** The place of the drive that a reason names, or the middle of a range; null if it names none. */
function placeIn(reason) {
  const [, at, to = at] = /\b(?:at|from) (-?\d[\d.]*(?:e[-+]?\d+)?)(?: to (-?\d[\d.]*))?/.exec(reason) ?? [];
  return at === undefined ? null : (Number(at) + Number(to)) / 2;
}

export class Layers {
  solution = null;
  answer = null;
  control = null;
  outline = null;
  wrong = new Map();

  /** `jump(degrees)` moves the crank; `onVerdict(solution)` is called once the verdict of a solution is complete. */
  constructor(board, jump, onVerdict) {
    Object.assign(this, { board, jump, told: onVerdict });
    for (const id of SETTINGS) listen(id, "change", () => this.#soonAgain());
    listen("layer-plates", "change", () => this.#drawPlates());
    board.seen.push(() => this.#drawPlates());
    board.redrawn.push(() => this.#see(board.motion?.outline ?? null));
  }

  /** The outline of the body, which may be drawn after the answer. */
  #see(outline) {
    if (this.outline === outline) return;
    const before = polygonOf(this.outline);
    this.outline = outline;
    if (before || polygonOf(outline)) this.#again();
  }

  options(solution, motion) {
    const sizes = SIZES.map((name) => [name, numberIn(`layer-${name}`)]).filter(([, value]) => value !== null),
      body = $("layer-body").checked ? bodyOf(this.outline, solution, motion) : null,
      [boards, pin_heads] = [$("layer-boards").value, $("layer-heads").checked];
    return { length_unit: motion.unit, boards, pin_heads, ...Object.fromEntries(sizes), ...(body && { body }) };
  }

  /** A new answer, or with null none: the layers of its first solutions are asked for, one after the other. */
  show(answer) {
    this.control?.abort();
    this.answer = answer;
    this.wrong = new Map();
    this.asked = new Set();
    if (!answer?.live) this.before = null;
    $("layers-card").hidden = !answer?.reply.solutions.length;
    if (!answer) return;
    this.control = new AbortController();
    this.#askAll(answer, this.control.signal);
  }

  /** Asks again once the click that ended an entry is over: what moves under the pointer is not pressed. */
  #soonAgain() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.#again(), CLICK_MS);
  }

  #again() {
    if (!this.answer) return;
    for (const solution of this.answer.reply.solutions) if (solution.verdict?.assembly) forget(solution);
    this.show(this.answer);
    this.told(this.solution);
    this.#describe();
  }

  async #askAll(answer, signal) {
    // after what is shown first: the selected one, then by rank
    await new Promise((done) => {
      setTimeout(done);
    });
    // while the search goes on the others may be replaced
    const first =
      answer.last === false ? [] : answer.reply.solutions.filter((solution) => solution.verdict).slice(0, FIRST);
    for (const solution of [this.solution, ...first])
      // oxlint-disable-next-line no-await-in-loop
      if (solution && !signal.aborted) await this.#ask(solution, answer, signal);
  }

  async #ask(solution, answer, signal) {
    if (!solution.verdict || solution.verdict.assembly || this.asked.has(solution)) return;
    this.asked.add(solution);
    try {
      const about = answer.within ?? answer.request,
        request = { linkage: solution, request: about, ...this.options(solution, answer.motion) },
        assembly = await (await ask("/v2/assembly", request, signal)).json();
      const { verdict } = solution,
        free = assembly.status === "free";
      const practical = verdict.practical ?? verdict.practical_without_collisions;
      solution.verdict = { ...verdict, practical, assembly, practical_without_collisions: practical && free };
      if (!free) solution.verdict.reasons = [...(verdict.reasons ?? []), `layers: ${assembly.reasons[0]}`];
    } catch (error) {
      if (error.name === "AbortError") return;
      this.wrong.set(solution, error.message);
    }
    if (signal.aborted) return;
    this.told(solution);
    if (solution === this.solution) this.#describe();
  }

  select(solution) {
    if (solution?.source === "moved" && !solution.verdict?.assembly) this.before = this.assembly ?? this.before;
    this.solution = solution;
    this.#describe();
    if (solution && this.answer && this.control) this.#ask(solution, this.answer, this.control.signal);
  }

  get assembly() {
    return this.solution?.verdict?.assembly ?? null;
  }

  #describe() {
    const { assembly, solution } = this,
      words = $("layers-note"),
      wrong = this.wrong.get(solution);
    $("layer-body").disabled = !polygonOf(this.outline);
    this.#drawPlates();
    if (!assembly && this.before && solution?.source === "moved" && !wrong) {
      words.textContent = AGAIN;
      return;
    }
    for (const id of ["stack", "layers-reasons"]) $(id).replaceChildren();
    $("stack").toggleAttribute("hidden", !assembly);
    if (!assembly) {
      const none = "Layers are searched for only if the service has found or refined the linkage.";
      words.textContent = wrong ?? (solution?.verdict ? "Searching for layers…" : none);
      return;
    }
    words.textContent = sentenceOf(assembly, unitOf(this.answer.motion));
    drawStack($("stack"), assembly);
    const reasons = assembly.reasons.slice(assembly.status === "blocked" ? 0 : 1);
    $("layers-reasons").append(...reasons.map((reason) => this.#reason(reason, assembly)));
  }

  /** A reason as a sentence, which leads to the place of the drive that it names. */
  #reason(reason, { pivot_supports: byCrank }) {
    const sentence = `${capital(rounded(reason))}.`.replaceAll(/(\d) degrees/g, "$1°"),
      at = byCrank ? placeIn(reason) : null;
    return element("li", "", at === null ? sentence : button(sentence, () => this.jump(at), "link"));
  }

  /** Plates on the canvas from the lowest layer up, each with its shadow; those that collide here in red. */
  #drawPlates() {
    const { board, assembly, solution } = this,
      { platesLayer: layer, joints, view, linkage, stale } = board,
      shown = assembly && $("layer-plates").checked && joints && linkage?.solution === solution && !stale;
    layer.replaceChildren();
    board.svg.classList.toggle("plated", Boolean(shown));
    if (!shown) return;
    const isAtDrive = (collision) => within(collision, joints.travel / RAD, driveTurns(solution)),
      hit = new Set(assembly.collisions.filter(isAtDrive).flatMap(({ pair }) => pair)),
      flat = assembly.parts.filter(({ kind }) => kind !== "board");
    flat.sort((a, b) => a.layers[1] - b.layers[1] || (a.kind === "plate" ? -1 : 1));
    for (const { name, kind, link, core, radius, slits } of flat) {
      const frame = joints.frames[link];
      if (!frame) continue;
      const path = (points) =>
          `M${points.map((point) => view.at(add(frame.at, turned(point, frame.angle))).join(" ")).join("L")}`,
        own = kind === "plate" ? name : name.split("_")[1],
        hits = hit.has(own) || (kind === "head" && hit.has(`head ${own}`)) ? " hit" : "",
        wide = 2 * radius * view.scale,
        d = path(core) + (core.length === 1 ? "h0" : core.length > 2 ? "Z" : "");
      const group = make("g", { class: `plate ${kind} ${name}${hits}`, "data-plate": name }, layer);
      make("path", { class: "edge", d, "stroke-width": wide + 2 * EDGE }, group);
      make("path", { class: "face", d, "stroke-width": wide }, group);
      for (const { first, last } of slits)
        make(
          "path",
          { class: "edge", d: path([first, last]), "stroke-width": assembly.sizes.hole * view.scale },
          group,
        );
    }
  }
}
