// The drive of the selected linkage: asks for cylinders, motors, locks and springs; the ends of one can be dragged.

import { Charts } from "./charts.js";
import { BEST, KINDS, armUnit, factsOf, nameOf, optionsOf, rowsOf } from "./choices.js";
import { button, definitions, element, make, namedRows, pathData, put, text } from "./drawing.js";
import { alike } from "./fit.js";
import { itemOf } from "./motion.js";
import { RAD, add, between, less, turned } from "./plane.js";
import { readQuestion, showQuestion } from "./question.js";
import { ask } from "./service.js";
import { $, capital, listen, spaced } from "./shell.js";
import { driveTurns } from "./timing.js";

const WIDE = 0.09; // of a cylinder's body, over its retracted length
const HANDLE = 8; // pixels
const REST_MS = 60; // after which a cylinder whose end is dragged is evaluated
const EARLIER = "These results belong to earlier entries. Press Find to search again.";
const AGAIN = "Searching again. The results shown belong to the linkage before it was moved.";

/** The joints of a four-bar's links: from them an arm leads to a pin of a drive. */
const JOINTS = { crank: (j) => [j.a, j.d], coupler: (j) => [j.d, j.c], rocker: (j) => [j.b, j.c] };

/** Lines of the arms that carry the ends of a drive on links of a four-bar: [[joint, end, joint], ..]. */
function armsOf(drive, joints, ground, pin) {
  const arm = (link, end) => {
    const [first, last] = (end && joints.a && JOINTS[link]?.(joints)) || [];
    return first ? [[first, end, last]] : [];
  };
  return [...arm(drive.link, pin), ...arm(drive.base_link, ground)];
}

/** The value of a curve between its even steps, numbers or points; null where it has none. */
function curveAt({ crank_angle: x }, values, at) {
  const last = x.length - 1,
    share = Math.min(1, Math.max(0, (at - x[0]) / (x[last] - x[0] || 1))) * last,
    k = Math.min(last - 1, Math.floor(share));
  return values[k] === null || values[k + 1] === null ? null : between(values[k], values[k + 1], share - k);
}

/** Return true if the ends of a drive can be dragged: those of a cylinder from the ground to a link of a four-bar. */
const isFree = (drive, solution) =>
  drive.kind === "actuator" && drive.base_link === "ground" && Boolean(JOINTS[drive.link] && solution.links);

export class Driving {
  answer = null;
  solution = null;
  shownAnswer = null; // the one of `found` on show
  drive = null;
  control = null;
  options = [];
  found = new WeakMap(); // {reply, question} for each solution

  /** `chosen()` is called when another drive is shown, or none. */
  constructor(board, player, chosen) {
    Object.assign(this, { board, player, chosen });
    listen("drive-find", "click", () => this.#find());
    listen("drive-kind", "change", () => showQuestion());
    listen("drive-catalogue", "change", () => {
      showQuestion();
      if ($("drive-catalogue").value === "own") $("drive-file").click();
    });
    listen("drive-file", "change", async () => {
      const [file] = $("drive-file").files;
      this.table = await file?.text();
      this.#say(file ? `Rows of ${file.name}.` : "");
    });
    listen("drive-card", "input change", () => this.#mark(Boolean(this.shownAnswer)));
    listen("drive-card", "keydown", (event) => {
      if (event.key !== "Enter" || !event.target.matches("input, select")) return;
      event.preventDefault();
      this.#find();
    });
    board.driven = () => this.#points();
    board.seen.push(() => this.#draw());
    board.redrawn.push(() => this.#draw());
    this.charts = new Charts($("drive-curves"), () => this.#curves());
    showQuestion();
  }

  /** A new answer; while a linkage like the one before stays selected, so does what was found for it. */
  show(answer) {
    this.answer = answer;
    $("drive-card").hidden = !answer?.reply.solutions.length;
  }

  /**
   * Selects a solution and shows what was found for it before. A question that is under way continues for a linkage
   * like the one before; for one that has been moved from it, it is asked again.
   */
  select(solution) {
    const before = this.solution,
      isMoved = solution?.source === "moved",
      isUnchanged = before === solution || (before && solution && !isMoved && alike(before, solution)),
      question = this.shownAnswer?.question ?? this.pending;
    this.solution = solution;
    if (isUnchanged) {
      if (this.found.has(before)) this.found.set(solution, this.found.get(before));
      return;
    }
    this.control?.abort();
    if (isMoved && question && !this.found.has(solution)) {
      this.#find(question);
      return;
    }
    this.#use(this.found.get(solution) ?? null);
    this.#say("");
  }

  /** Marks what is shown as found for `earlier` fields, because its forces are of another load. */
  #mark(earlier) {
    $("drive-card").classList.toggle("other", earlier);
    if (earlier) this.#say(EARLIER);
  }

  /** Drive that is shown, which is exported with the linkage. */
  get shown() {
    return this.drive && this.drive.kind ? this.drive : null;
  }

  /** Units and names in the shown numbers. */
  get #how() {
    const { motion } = this.answer;
    return { unit: motion.unit, turns: driveTurns(this.solution), item: itemOf(motion) };
  }

  #say(words, bad = false) {
    $("drive-note").textContent = words;
    $("drive-note").classList.toggle("bad", bad);
  }

  /** Asks a question about the selected linkage; null if another one came between. Throws Error with a sentence. */
  async #ask(question) {
    const { request, within = request, motion } = this.answer,
      control = new AbortController(),
      about = { linkage: this.solution, request: within, length_unit: motion.unit, top: BEST };
    this.control?.abort();
    this.control = control;
    const reply = await (await ask("/v2/drives", { ...about, ...question }, control.signal)).json();
    return control.signal.aborted ? null : reply;
  }

  /** Asks what the fields say, or for a linkage that was moved `again` what was asked for the one before. */
  async #find(again = null) {
    if (!this.solution) return;
    const { drive } = this;
    this.#say(again ? AGAIN : "Looking…");
    try {
      const question = again ?? readQuestion(this.table);
      this.pending = question;
      const reply = await this.#ask(question);
      if (!reply) return;
      this.pending = null;
      this.found.set(this.solution, { reply, question });
      this.#use({ reply, question }, again && drive?.kind);
      if (again && drive?.byHand) this.#moveTo(drive);
      if (!again) this.board.reveal(this.board.driven());
      const found = reply.drives.length + reply.springs.length,
        because = reply.refused.length ? ", because of what is listed below" : "",
        none = found ? [] : [`No sensible ${question.springs ? "spring" : "drive"}${because}.`];
      this.#say([...none, ...reply.notes.map((sentence) => `${capital(sentence)}.`)].join(" "), !found);
    } catch (error) {
      this.#fail(error, again);
    }
  }

  #fail(error, isLost) {
    if (error.name === "AbortError") return;
    this.pending = null;
    if (isLost) this.#use(null);
    this.#say(error.message, true);
  }

  /** Shows {reply, question}, and of its options that of a kind if there is one. */
  #use(found, kind = null) {
    this.shownAnswer = found;
    this.#mark(false);
    this.options = found ? optionsOf(found.reply) : [];
    this.#choose(this.options.find((option) => option.kind === kind) ?? this.options[0] ?? null);
  }

  #choose(drive) {
    this.drive = drive;
    this.#list();
    $("drive-numbers").replaceChildren(...(drive ? [namedRows(this.rows())] : []));
    this.charts.draw();
    this.#draw();
    this.chosen();
  }

  /** Shows a cylinder with other ends at once, and its numbers once the service has computed them. */
  #moveTo(drive) {
    this.drive = { ...drive, byHand: true };
    this.#draw();
    clearTimeout(this.resting);
    this.resting = setTimeout(() => this.#evaluate().catch((error) => this.#fail(error, false)), REST_MS);
  }

  async #evaluate() {
    const { link, count, ground_point, pin_on_link, from } = this.drive,
      { load } = this.shownAnswer.question,
      ends = { kind: "actuator", links: [link], count, ground_point, pin_on_link },
      reply = await this.#ask({ load, drives: [ends] });
    if (!reply) return;
    const [evaluated] = reply.drives;
    if (evaluated) this.#choose({ ...evaluated, byHand: true, from });
    this.#say(evaluated ? "" : `${capital(reply.refused[0].reason)}.`, !evaluated);
  }

  #list() {
    const refused = this.shownAnswer?.reply.refused ?? [];
    const cards = this.options.map((drive) => {
      const act = () => {
        this.#choose(drive);
        this.board.reveal(this.board.driven());
      };
      const pressed = drive === this.drive || (this.drive?.byHand && this.drive.from === drive),
        card = button("", act, "", { "aria-pressed": String(Boolean(pressed)) });
      card.append(element("strong", "", nameOf(drive)), definitions(factsOf(drive, this.#how)));
      return card;
    });
    $("drive-found").replaceChildren(...cards);
    $("drive-found").hidden = !cards.length;
    $("drive-reasons").hidden = !refused.length;
    $("drive-reasons").open = !cards.length;
    $("drive-refused").replaceChildren(
      ...refused.map(({ kind, link, name, reason }) => {
        const sort = KINDS[kind] ? `${KINDS[kind]} on the ${spaced(link)}` : `${kind} spring, ${link}`;
        const why = reason.replace("reach_max", "“pin within”");
        return element("li", "", `${sort}${name ? ` (${name})` : ""}: ${why}.`);
      }),
    );
  }

  /** Rows [name, value] of what is shown: for the card and for the sheet. */
  rows() {
    return this.drive ? rowsOf(this.drive, this.#how) : [];
  }

  /** Points of the drive at the first pose, which the view should hold. */
  #points() {
    const { drive } = this;
    if (!drive) return [];
    if (drive.springs) return drive.springs.flatMap(({ points, point }) => points ?? [point]);
    if (drive.kind === "rotary") return [drive.motor];
    return ["ground", "knee", "pin"].map((name) => drive.curve[name]?.[0]).filter(Boolean);
  }

  /** Charts of force, torque and arm, the force beside the least peak that any cylinder of this stroke has. */
  #curves() {
    const { drive, shownAnswer } = this;
    if (!drive) return [];
    const sense = this.player.shown?.pass.sense ?? 1,
      { unit, turns } = this.#how,
      axis = turns ? { sense } : { sense, degreesX: false, xName: ` ${unit}` },
      { curve } = drive.springs?.[0] ?? drive,
      x = curve.crank_angle,
      order = [...x.keys()].sort((i, j) => sense * (x[i] - x[j])),
      inOrder = (values) => order.map((k) => values[k]);
    const plot = (title, ...series) => {
      const curves = series.map((line) => ({ ...line, values: inOrder(line.values) }));
      return [title, { x: inOrder(x).map((at) => sense * at), series: curves, height: 140, ...axis }];
    };
    const thin = { dash: [6, 4], width: 1.2 };
    if (drive.springs) {
      const title = `Torque of the drive with the springs, N·${unit} (dashed: without)`,
        without = { values: shownAnswer.reply.torque.torque, colour: "muted", ...thin };
      return [plot(title, { values: curve.torque, colour: "body" }, without)];
    }
    const { kind, peak_force_bound: bound } = drive,
      level = bound ? [{ values: x.map(() => bound), colour: "box", ...thin }] : [],
      name = kind === "dyad" ? "Torque of the motor, forwards" : "Torque",
      push = `Force of the ${KINDS[kind]}, push or pull, N${bound ? " (dashed: no peak is below this)" : ""}`;
    const list = [
      curve.force && plot(push, { values: curve.force.map(Math.abs), colour: "body" }, ...level),
      curve.torque && plot(`${name}, N·${unit}`, { values: curve.torque, colour: "body" }),
      curve.arm && plot(`Moment arm, ${armUnit(unit, turns)}`, { values: curve.arm.map(Math.abs), colour: "path" }),
    ];
    return list.filter(Boolean);
  }

  /** The drive on the canvas at the crank's place: its parts, and handles at its ends. */
  #draw() {
    const { board, drive, solution } = this,
      { driveLayer: layer, joints } = board;
    if (joints && solution === this.player.shown?.solution) this.charts.mark(Number($("slider").value));
    // an end that has the keys keeps them when it is drawn anew
    this.focused = layer.contains(document.activeElement) ? document.activeElement.dataset.end : null;
    layer.replaceChildren();
    if (!drive || !joints || !board.linkage || board.stale || solution !== this.player.shown?.solution) return;
    const at = this.player.shown.pass.turns ? joints.travel / RAD : this.player.travel;
    if (drive.springs) for (const spring of drive.springs) this.#drawSpring(spring, at);
    else if (drive.kind === "rotary") this.#dot(drive.motor, "motor");
    else {
      const { curve } = drive,
        along = (name) => (curve[name] ? curveAt(curve, curve[name], at) : drive.motor),
        [ground, pin] = isFree(drive, solution) ? this.#endsOf(drive) : ["ground", "pin"].map(along),
        knee = along("knee");
      if (!ground || !pin) return;
      if (solution.links) for (const arm of armsOf(drive, joints, ground, pin)) this.#line("arm", arm);
      if (curve.knee && knee) {
        this.#line("rod", [ground, knee, pin]);
        for (const joint of [ground, knee, pin]) this.#dot(joint, "joint");
      } else this.#drawCylinder(ground, pin);
    }
  }

  /** The ends of a cylinder whose ends are free, where the crank stands now. */
  #endsOf({ ground_point, pin_on_link, link }) {
    const { at, angle } = this.board.joints.frames[link];
    return [ground_point, add(at, turned(pin_on_link, angle))];
  }

  #drawSpring({ curve, kind, point, between: links }, at) {
    // a torsion spring between two moving links is shown only by its numbers
    if (kind === "torsion") {
      if (links.includes("ground")) this.#dot(point, "motor");
      return;
    }
    const pairs = curve.ends.map((pair) => pair.flat()),
      ends = curveAt(curve, pairs, at);
    if (ends) this.#line(kind === "gas" ? "rod" : "spring", [ends.slice(0, 2), ends.slice(2)]);
  }

  #drawCylinder(ground, pin) {
    const { drive, solution } = this,
      rod = less(pin, ground),
      length = Math.hypot(...rod),
      [x, y] = rod.map((part) => part / length),
      body = 0.85 * drive.retracted,
      half = (WIDE / 2) * drive.retracted,
      corner = (along, across) => add(ground, [x * along - y * across, y * along + x * across]);
    const low = 0.04 * body,
      corners = [corner(low, half), corner(body, half), corner(body, -half), corner(low, -half)];
    this.#line("rod", [ground, pin]);
    this.#line("cylinder", corners, true);
    const free = isFree(drive, solution);
    this.#handle(ground, "ground", free);
    this.#handle(pin, "pin", free);
    put(this.board.driveLayer, { "data-length": text(length, 6) });
  }

  #line(name, points, closed = false) {
    const { view, driveLayer } = this.board;
    make("path", { class: `drive-${name}`, d: pathData(points, view) + (closed ? "Z" : "") }, driveLayer);
  }

  #dot(position, name) {
    const [cx, cy] = this.board.view.at(position);
    return make("circle", { class: `drive-${name}`, cx, cy, r: name === "motor" ? 12 : 5 }, this.board.driveLayer);
  }

  /** An end of a cylinder, which drags and arrow keys move. */
  #handle(position, end, free) {
    const dot = this.#dot(position, "end"),
      label = `${end === "ground" ? "Ground point" : "Pin"} of the cylinder: drag, or arrow keys`;
    if (!free) return;
    put(dot, { r: HANDLE, tabindex: 0, role: "button", "data-end": end, "aria-label": label });
    if (this.focused === end) dot.focus({ preventScroll: true });
    dot.addEventListener("keydown", (event) => {
      const by = this.board.nudge(event);
      if (!by) return;
      event.preventDefault();
      event.stopPropagation();
      this.#put(end, add(position, by));
    });
    dot.addEventListener("pointerdown", (event) => {
      const move = (px, py) => this.#put(end, this.board.view.world(px, py));
      event.stopPropagation();
      this.player.stop();
      this.board.follow(event, move, () => {});
    });
  }

  /** One end is put elsewhere by hand, where the crank stands now. */
  #put(end, position) {
    const { drive } = this,
      { at, angle } = this.board.joints.frames[drive.link];
    const ends = end === "ground" ? { ground_point: position } : { pin_on_link: turned(less(position, at), -angle) };
    this.#moveTo({ ...drive, ...ends, from: drive.from ?? drive });
  }
}
