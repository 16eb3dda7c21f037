// Layers of the plates of a linkage: asked for after an answer, drawn from the side, plates and collisions on the canvas.

import { numberIn } from "./decimal.js";
import { button, element, make, put, text } from "./drawing.js";
import { driveTurns } from "./drive.js";
import { fitOf } from "./fit.js";
import { unitOf } from "./motion.js";
import { RAD } from "./plane.js";
import { ask } from "./service.js";
import { $, capital } from "./shell.js";
import { layersOf } from "./verdict.js";

const FIRST = 10; // solutions of an answer whose layers are asked for without being selected
const MOST_CORNERS = 200;
const COLUMNS = ["M", "G", "K", "Q", "A1", "A", "A2", "D", "P", "C", "B1", "B", "B2"]; // pins from left to right
const WIDE = 64,
  HIGH = 26,
  LEFT = 42; // pixels between columns and layers of the stack, and beside it
const EDGE = 1.5;
const SIZES = Object.fromEntries(
  ["hole", "width", "thickness", "clearance", "kerf", "scale"].map((name) => [name, `layer-${name}`]),
); // part settings, for layers and every file

/** The longest closed line of an outline as corners, thinned out where it has too many; null where none is closed. */
function polygonOf(outline) {
  const closed = (outline ?? [])
    .filter((line) => line.length > 3 && line[0].every((value, i) => value === line.at(-1)[i]))
    .map((line) => line.slice(0, -1));
  if (!closed.length) return null;
  const longest = closed.reduce((a, b) => (b.length > a.length ? b : a)),
    step = Math.ceil(longest.length / MOST_CORNERS);
  return longest.filter((_, k) => k % step === 0);
}

/** The body's corners as the service takes them: where no rotation is wanted, in the axes of the request at the first sample. */
function bodyOf(outline, solution, motion) {
  const corners = polygonOf(outline);
  if (!corners || !solution.mount || solution.body_offset !== null) return corners;
  const turn = fitOf(solution, motion).linkage.at(0)?.coupler ?? 0,
    cosine = Math.cos(turn),
    sine = Math.sin(turn);
  return corners.map(([x, y]) => [cosine * x - sine * y, sine * x + cosine * y]);
}

const placeText = (value, sign) => `${text(Math.abs(value) < 1e-9 ? 0 : value, 5)}${sign}`;
const inWords = (pair) =>
  pair
    .map((name) =>
      name.startsWith("head ") ? `head of pin ${name.slice(5)}` : name.length <= 2 ? `pin ${name}` : name,
    )
    .join(" and ");

/** Whether a place of the drive lies within a collision, also one over the seam of a turn. */
const within = ({ from, to }, place, turns) =>
  (turns ? [-360, 0, 360] : [0]).some((turn) => from <= place + turn && place + turn <= to);

const CLICK_MS = 300;

export class Layers {
  /** `jump(degrees)` moves the crank; `told(solution)` is called when the verdict of a solution has its assembly. */
  constructor(board, jump, told) {
    Object.assign(this, {
      board,
      jump,
      told,
      solution: null,
      answer: null,
      control: null,
      outline: null,
      wrong: new Map(),
    });
    for (const name of ["layer-boards", "layer-heads", "layer-body", ...Object.values(SIZES)])
      $(name).addEventListener("change", () => this.#soonAgain());
    $("layer-plates").addEventListener("change", () => this.#drawPlates());
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
    const sizes = Object.entries(SIZES)
      .map(([name, id]) => [name, numberIn(id)])
      .filter(([, value]) => value !== null);
    const body = $("layer-body").checked ? bodyOf(this.outline, solution, motion) : null;
    return {
      length_unit: motion.unit,
      boards: $("layer-boards").value,
      heads: $("layer-heads").checked,
      ...Object.fromEntries(sizes),
      ...(body ? { body } : {}),
    };
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
    const first = answer.last === false ? [] : answer.reply.solutions.filter((one) => one.verdict).slice(0, FIRST);
    for (const solution of [this.solution, ...first])
      if (solution && !signal.aborted) await this.#ask(solution, answer, signal); // oxlint-disable-line no-await-in-loop
  }

  async #ask(solution, answer, signal) {
    if (!solution.verdict || solution.verdict.assembly || this.asked.has(solution)) return;
    this.asked.add(solution);
    try {
      const assembly = await (
        await ask(
          "/v2/assembly",
          { linkage: solution, request: answer.request, ...this.options(solution, answer.motion) },
          signal,
        )
      ).json();
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

  /** Behind a place of the drive: degrees, or for a slider or cylinder the unit of length. */
  get #sign() {
    return driveTurns(this.solution) ? "°" : ` ${this.answer.motion.unit}`;
  }

  get assembly() {
    return this.solution?.verdict?.assembly ?? null;
  }

  #describe() {
    const { assembly } = this,
      host = $("stack"),
      words = $("layers-note"),
      list = $("layers-reasons"),
      jumps = $("layers-jumps");
    $("layer-body").disabled = !polygonOf(this.outline);
    if (!assembly && this.before && this.solution?.source === "moved" && !this.wrong.has(this.solution)) {
      words.textContent = "Looking for layers again: what is shown is of the linkage before it was moved.";
      this.#drawPlates();
      return;
    }
    for (const part of [host, list, jumps]) part.replaceChildren();
    host.setAttribute("hidden", "");
    this.#drawPlates();
    if (!assembly) {
      words.textContent =
        this.wrong.get(this.solution) ??
        (this.solution?.verdict
          ? "Looking for layers…"
          : "Layers are looked for where the service has found the linkage.");
      return;
    }
    const { status, count, smallest_gap: gap } = assembly,
      unit = unitOf(this.answer.motion);
    const state = {
      free: `Nothing collides in ${layersOf(count)}`,
      touching: `In ${layersOf(count)} parts may just touch`,
      blocked: assembly.exhaustive
        ? "Cannot be built so: parts collide in every order of the layers allowed"
        : "Parts collide in every order of layers that was tried",
    }[status];
    const { hole, width, thickness } = assembly.sizes,
      sizes = `holes ${text(hole, 4)}, width ${text(width, 4)}, thickness ${text(thickness, 4)} ${unit}`;
    words.textContent = `${state}${gap ? `; least gap ${text(gap.value, 4)} ${unit} beyond the clearance, ${inWords(gap.pair)} at ${placeText(gap.crank_angle, this.#sign)}` : ""}; ${sizes}.`;
    host.removeAttribute("hidden");
    drawStack(host, assembly);
    list.append(
      ...assembly.reasons
        .filter((_, k) => status === "blocked" || k > 0)
        .map((one) => element("li", "", `${capital(one)}.`.replaceAll(/(\d) degrees/g, "$1°"))),
    );
    this.#offerJumps(assembly, jumps);
  }

  #offerJumps({ collisions, stops, pivot_supports: supports, fewer_layers: fewer }, host) {
    const places = collisions.flatMap(({ pair, from, to }) => [
      [`${inWords(pair)} collide`, from],
      [`${inWords(pair)} part`, to],
    ]);
    if (!collisions.length) {
      places.push(
        ...Object.values(fewer)
          .filter(Boolean)
          .map(({ pair, from }) => [`in fewer layers ${inWords(pair)} collide`, from]),
      );
      places.push(
        ...Object.values(stops)
          .filter(({ crank_angle }) => crank_angle !== null)
          .map(({ crank_angle, cause, pair }) => [
            cause === "loop" ? "the loop ends" : `stop: ${inWords(pair)}`,
            crank_angle,
          ]),
      );
    }
    host.append(
      ...places.map(([words, angle]) => button(`${words}: ${placeText(angle, this.#sign)}`, () => this.jump(angle))),
    );
    host.hidden = !places.length || !supports;
  }

  /** Plates on the canvas from the lowest layer up, each with its shadow; those that collide here in red. */
  #drawPlates() {
    const { board, assembly } = this,
      { platesLayer: layer, joints, view } = board;
    layer.replaceChildren();
    board.svg.classList.toggle(
      "plated",
      Boolean(
        assembly && $("layer-plates").checked && joints && board.linkage?.solution === this.solution && !board.stale,
      ),
    );
    if (!board.svg.classList.contains("plated")) return;
    const degrees = joints.travel / RAD,
      hit = new Set(
        assembly.collisions
          .filter((one) => within(one, degrees, driveTurns(this.solution)))
          .flatMap(({ pair }) => pair),
      );
    const flat = assembly.parts
      .filter(({ kind }) => kind !== "board")
      .toSorted((a, b) => a.layers[1] - b.layers[1] || (a.kind === "plate" ? -1 : 1));
    for (const { name, kind, link, core, radius, slits } of flat) {
      const frame = joints.frames[link];
      if (!frame) continue;
      const { at, angle } = frame,
        cosine = Math.cos(angle),
        sine = Math.sin(angle);
      const placed = ([x, y]) => view.at([at[0] + cosine * x - sine * y, at[1] + sine * x + cosine * y]);
      const points = core.map(placed),
        wide = 2 * radius * view.scale;
      const own = kind === "plate" ? name : name.split("_")[1],
        d = `M${points.map(([x, y]) => `${x.toFixed(1)} ${y.toFixed(1)}`).join("L")}${points.length === 1 ? "h0" : points.length > 2 ? "Z" : ""}`;
      const group = make(
        "g",
        {
          class: `plate ${kind} ${name}${hit.has(own) || (kind === "head" && hit.has(`head ${own}`)) ? " hit" : ""}`,
          "data-plate": name,
        },
        layer,
      );
      make("path", { class: "edge", d, "stroke-width": (wide + 2 * EDGE).toFixed(1) }, group);
      make("path", { class: "face", d, "stroke-width": wide.toFixed(1) }, group);
      for (const { first, last } of slits)
        make(
          "path",
          {
            class: "edge",
            d: `M${placed(first).join(" ")}L${placed(last).join(" ")}`,
            "stroke-width": (assembly.sizes.hole * view.scale).toFixed(1),
          },
          group,
        );
    }
  }
}

function forget(solution) {
  const { assembly: _gone, reasons = [], ...rest } = solution.verdict;
  solution.verdict = {
    ...rest,
    practical_without_collisions: null,
    reasons: reasons.filter((one) => !one.startsWith("layers:")),
  };
}

/** The stack from the side: a row a layer, plates between their pins, pins upright through the layers that they fill. */
export function drawStack(svg, { count, parts, status }) {
  const used = COLUMNS.filter((name) => parts.some((one) => one.name.endsWith(`_${name}`)));
  const x = (name) => LEFT + 30 + WIDE * used.indexOf(name),
    rows = parts.flatMap(({ layers }) => layers),
    low = Math.min(...rows),
    high = Math.max(...rows);
  const y = (layer) => 8 + HIGH * (high - layer),
    width = LEFT + WIDE * (used.length - 1) + 90,
    height = y(low) + HIGH + 4;
  put(svg, {
    viewBox: `0 0 ${width} ${height}`,
    width,
    height,
    role: "img",
    "aria-label": `${count} layers from the side, from the top: ${parts
      .filter(({ kind }) => kind === "plate")
      .toSorted((a, b) => b.layers[0] - a.layers[0])
      .map(({ name, layers }) => `${name} in layer ${layers[0]}`)
      .join(", ")}`,
  });
  svg.classList.toggle("blocked", status === "blocked");
  for (let layer = 1; layer <= count; layer += 1)
    make("text", { class: "number", x: 4, y: y(layer) + HIGH / 2 + 4 }, svg).textContent = layer;
  for (const { name, kind, holes, slits, layers } of parts) {
    const at =
      kind === "board"
        ? [x(used[0]) - 26, x(used.at(-1)) + 26]
        : [...holes, ...slits].filter(({ pin }) => used.includes(pin)).map(({ pin }) => x(pin));
    if (kind === "plate" || kind === "board") {
      const left = Math.min(...at) - (kind === "board" ? 0 : 14),
        right = Math.max(...at) + (kind === "board" ? 0 : 14);
      make(
        "rect",
        {
          class: `${kind} ${name}`,
          x: left,
          y: y(layers[0]) + 4,
          width: Math.max(28, right - left),
          height: HIGH - 8,
          rx: 3,
        },
        svg,
      );
      make("text", { class: `name ${kind}`, x: (left + right) / 2, y: y(layers[0]) + HIGH / 2 + 4 }, svg).textContent =
        kind === "board" ? "board" : name;
    }
  }
  for (const { name, kind, layers } of parts) {
    const own = name.split("_")[1],
      wide = kind === "head" ? 9 : 4;
    if (kind === "plate" || kind === "board") continue;
    make(
      "rect",
      {
        class: kind,
        x: x(own) - wide,
        y: y(layers[1]) + (kind === "head" ? 8 : 2),
        width: 2 * wide,
        height: HIGH * (layers[1] - layers[0] + 1) - (kind === "head" ? 16 : 4),
        rx: 1.5,
      },
      svg,
    );
    if (kind !== "head") make("text", { class: "pin-name", x: x(own) + 7, y: y(layers[1]) + 1 }, svg).textContent = own;
  }
}
