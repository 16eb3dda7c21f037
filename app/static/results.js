// The solutions of an answer: the list, and the numbers and files of the selected one.

import { card, grouped, nameOf, sign, sorted } from "./cards.js";
import { redrawOn } from "./charts.js";
import { element, tableOf } from "./drawing.js";
import { Driving } from "./driving.js";
import { alike, errorText, fitOf, worstRows, worstWords } from "./fit.js";
import { assessed } from "./follow.js";
import { fromJoints } from "./hand.js";
import { JointFields } from "./joints.js";
import { Layers } from "./layers.js";
import { itemOf } from "./motion.js";
import { numberBlocks, numberRows, placesInWords } from "./numbers.js";
import { Preview } from "./parts.js";
import { Player, trajectory } from "./player.js";
import { ask, download } from "./service.js";
import { $, build, copy, listed, listen } from "./shell.js";
import { driveTurns } from "./timing.js";
import { mark, plainNote, reasons } from "./verdict.js";

const CARDS = ["results", "curves-card", "numbers-card", "files-card", "player"];
const ENDINGS = { mjcf: "xml", plates: "plates.dxf", stl: "stl.zip", parts: "parts.csv" };
const OF_PARTS = ["step", "3mf", "stl", "parts"];
const WITH_DRIVE = ["dxf", "csv", "svg", "plates", ...OF_PARTS];
const ENDS = { tolerance: "tolerance reached", converged: "no further improvement found", budget: "the time was up" };
const REST_MS = 120; // without a further drag, after which the curves are drawn anew
const OUTSIDE = "Parts lie outside the view: Fit shows all";

export function note(sentence) {
  $("export-note").textContent = sentence;
}

const isHand = (solution) => solution.source === "hand";
export class Results {
  answer = null;
  solution = null;
  picked = false;
  pinned = [];

  /** `beginStep(kind)` begins an undo step; `changed()` is called when the user has moved a joint or picked a card. */
  constructor(board, beginStep, changed) {
    Object.assign(this, { keep: beginStep, changed, board, player: new Player(board) });
    const jump = (degrees) => {
      this.player.stop();
      this.player.goto(degrees);
    };
    this.layers = new Layers(board, jump, (solution) => this.#judgedAnew(solution));
    this.driving = new Driving(board, this.player, () => this.preview.soon());
    this.preview = new Preview(
      () => this.solution?.verdict?.assembly && this.#fileRequest("plates"),
      (request, signal) => ask("/v2/export", request, signal),
    );
    const drag = (name, position) => this.drag(name, position, null);
    this.fields = new JointFields(board, drag, () => this.player.stop());
    listen("copy", "click", () => {
      const lines = this.#rows().map((row) => row.join("\t"));
      copy(lines.join("\n"), "The numbers are copied.", note);
    });
    for (const exportButton of document.querySelectorAll("[data-format]"))
      exportButton.addEventListener("click", () => this.#save(exportButton.dataset.format));
    listen("sort", "change", () => this.#list());
    listen("drive-find", "click", () => (this.picked = true));
    listen("overlay", "change", () => this.#showOthers());
    board.seen.push(() => this.#movePictures());
    redrawOn($("solutions"), () => this.answer && this.#list());
  }

  /** Shows an answer {request, reply, motion}, or none; a further answer to the same request keeps the picked card. */
  show(answer, further = false) {
    if (!further) this.picked = false;
    // the view stays for further answers, and where the user has moved it to look at the linkages of this request
    const request = JSON.stringify(answer?.request),
      isRepeated = this.answer && JSON.stringify(this.answer.request) === request,
      stays = further || (this.board.moved && isRepeated);
    const before = this.picked ? this.solution : null,
      solutions = answer?.reply.solutions ?? [];
    let selection = before && solutions.find((solution) => alike(solution, before));
    // a further answer to the same question need not have the linkage that the user holds
    if (before && !selection && this.answer === answer)
      solutions.push((selection = Object.assign(before, { rank: solutions.length + 1 })));
    this.answer = answer;
    for (const id of CARDS) $(id).hidden = !solutions.length;
    if (!solutions.length) {
      this.#clear();
      return;
    }
    const { motion, live, stored, refined } = answer,
      { report } = answer.reply,
      item = itemOf(motion);
    answer.size = report.length_scale ?? 1;
    const from = live
      ? "moved with the motion"
      : stored
        ? "searched beforehand"
        : `${Math.round(report.elapsed_ms.total)} ms`;
    const ended = live ? "" : `${refined ? "Descent" : "Search"} ended: ${ENDS[report.stopped_by]}.`;
    $("results-note").textContent = `largest errors${answer.within ? "" : `, at ${item} (no.)`} · ${from}`;
    $("trace-note").textContent = [ended, ...report.notes.map((sentence) => plainNote(sentence, item))].join(" ");
    this.solution = selection ?? solutions[0];
    this.#list();
    this.layers.show(answer);
    this.driving.show(answer);
    this.#select(this.solution, stays ? "holds" : "all", false);
    // the linkage first: charts take as long to draw as all the rest
    clearTimeout(this.charts);
    this.charts = setTimeout(() => this.player.drawCurves());
  }

  #clear() {
    for (const panel of [this.layers, this.driving]) {
      panel.show(null);
      panel.select(null);
    }
    this.solution = null;
    $("solutions").replaceChildren();
    this.pinned = [];
    this.board.showOthers([]);
    this.player.clear();
  }

  /** Selects the solution that is like `target`; adds `target`, with errors computed here, if there is none. */
  choose(target) {
    const { motion, reply } = this.answer;
    let found =
      reply.solutions.find((solution) => solution === target) ??
      reply.solutions.find((solution) => alike(solution, target));
    if (!found) {
      const bare = { verdict: null, rank: null, determination: { ill_posed: false, active_limits: [] } };
      found = { ...assessed({ ...target, ...bare }, motion).solution, source: "link" };
      reply.solutions.push(found);
    }
    this.picked = true;
    this.#select(found, "holds");
    this.#list();
  }

  /** Shows a linkage that is being moved with the motion; the rest of the page is of the one before until it rests. */
  track(solution, motion, k) {
    clearTimeout(this.later);
    this.player.track(solution, motion, k);
    this.board.tell(`off by ${worstWords(worstRows(this.player.shown, motion, this.answer.size), motion)}`);
  }

  /** Shows the selected linkage again in place of one that was being moved. */
  untrack() {
    if (this.solution) this.player.show(this.solution, this.answer.motion, false, false);
  }

  /** Lists solutions that were added to the answer. */
  extend() {
    this.#list();
    this.#showOthers();
  }

  /** State that undo restores: the linkage changed by hand, the selected linkage, and its crank angle. */
  get state() {
    const { solution, player } = this;
    return solution && { hand: this.answer.reply.solutions.find(isHand), solution, travel: player.travel };
  }

  restore({ hand, solution, travel }) {
    const { reply } = this.answer,
      computed = reply.solutions.filter((candidate) => !isHand(candidate)),
      all = hand ? [...computed, hand] : computed;
    reply.solutions = all;
    this.#select(
      all.find((candidate) => candidate === solution) ?? all.find((candidate) => alike(candidate, solution)) ?? all[0],
    );
    this.player.goto(travel);
    this.#list();
  }

  /**
   * Moves a joint of the selected linkage, dragged or typed, and computes its errors anew. Drags of one `kind` are one
   * step of undo. Returns what hinders it, or null.
   */
  drag(name, position, kind = `joint ${name}`) {
    const { motion, reply } = this.answer ?? {};
    if (!(this.solution?.mount || this.solution?.guides) || !this.board.joints)
      return "without positions the location of a linkage is undefined.";
    this.player.stop();
    const moved = fromJoints({ ...this.board.joints, [name]: position }, this.player.travel, this.solution);
    if (!moved) return "two joints would coincide there.";
    this.keep(kind);
    const { solution, shift, closes } = assessed(moved, motion),
      travel = this.player.travel - shift,
      old = reply.solutions.findIndex(isHand);
    if (old >= 0) reply.solutions[old] = solution;
    else reply.solutions.push(solution);
    Object.assign(this, { solution, picked: true });
    this.player.show(solution, motion, false, false);
    this.player.goto(travel);
    this.layers.select(solution);
    this.driving.select(solution);
    this.preview.soon();
    clearTimeout(this.later);
    this.later = setTimeout(() => this.player.drawCurves(), REST_MS);
    this.#showNumbers();
    this.#list();
    this.changed();
    const { position_max, rotation_max } = solution.errors,
      off = listed(errorText(position_max, 1e-300, ` ${motion.unit}`), errorText(rotation_max, 1e-300, "°"));
    this.board.tell(closes ? off : `does not close at every ${itemOf(motion)}`);
    return null;
  }

  /** The numbers to be copied, with all digits. */
  #rows() {
    const { solution, answer } = this,
      { verdict } = solution,
      item = itemOf(answer.motion),
      drivePositions = placesInWords(solution, answer.motion, 17);
    const rows = numberRows(solution, answer, 17);
    if (drivePositions) rows.push([driveTurns(solution) ? "Crank angles" : "Travel", drivePositions.join(", ")]);
    if (verdict) rows.push(["Verdict", mark(verdict, item).text]);
    return verdict ? [...rows, ...reasons(verdict, item).map((reason) => ["Reason", reason])] : rows;
  }

  #list() {
    const { motion, reply, size } = this.answer,
      host = $("solutions"),
      active = host.contains(document.activeElement),
      groups = grouped(sorted(reply.solutions, $("sort").value));
    const choose = (solution) => {
      this.picked = true;
      this.#select(solution);
      this.changed();
    };
    const item = (solution) => {
      const compare = (on) => this.#compare(solution, on);
      return card(solution, motion, size, this.pinned.includes(solution), () => choose(solution), compare);
    };
    this.pinned = this.pinned
      .map((pinned) => reply.solutions.find((solution) => alike(pinned, solution)))
      .filter(Boolean);
    const parts = groups.map(([kind, solutions]) => {
      const list = build("ol", {}, solutions.map(item));
      return groups.length > 1 ? [element("h3", "", kind), list] : [list];
    });
    host.replaceChildren(...parts.flat());
    this.cards = groups.flatMap(([, solutions]) => solutions);
    this.share = null;
    this.#movePictures();
    this.#showCompared();
    this.#press();
    if (active) host.querySelector("[aria-pressed=true]")?.focus({ preventScroll: true });
  }

  /** Moves the linkages of the cards with the one on the canvas. */
  #movePictures() {
    const { share } = this.player;
    if (share === this.share || $("choose").hidden) return;
    this.share = share;
    for (const picture of $("solutions").querySelectorAll("svg")) picture.move?.(share);
  }

  /** Adds a solution to the two that are compared, or takes it away. */
  #compare(solution, on) {
    this.pinned = [...this.pinned.filter((pinned) => pinned !== solution), ...(on ? [solution] : [])].slice(-2);
    this.#list();
    this.#showOthers();
  }

  /** Two solutions side by side, in a row for each number that both have. */
  #showCompared() {
    const { pinned, answer } = this,
      host = $("compare");
    host.hidden = !pinned.length;
    if (pinned.length < 2) {
      host.replaceChildren(element("p", "note", "Choose a second linkage to compare."));
      return;
    }
    const [first, second] = pinned.map((solution) => {
      const words = mark(solution.verdict, itemOf(answer.motion))?.text ?? "not checked";
      return new Map([...numberRows(solution, answer), ["Verdict", words]]);
    });
    const names = [...first.keys()].filter((name) => second.has(name)),
      rows = names.map((name) => [name, first.get(name), second.get(name)]);
    host.replaceChildren(element("h3", "", "Compared"), tableOf(["", ...pinned.map(nameOf)], rows, true));
  }

  /** The verdict of a solution has its layers: its card and, where it is selected, its numbers say so. */
  #judgedAnew(solution) {
    const index = this.cards?.indexOf(solution) ?? -1,
      item = $("solutions").querySelectorAll("li")[index];
    item?.querySelector(".verdict")?.replaceWith(sign(solution.verdict, this.answer.motion));
    if (solution !== this.solution) return;
    this.#showNumbers(true);
    this.preview.soon();
  }

  #press() {
    for (const [k, item] of $("solutions").querySelectorAll("li").entries())
      item.firstChild.setAttribute("aria-pressed", String(this.cards[k] === this.solution));
  }

  /** `fit` the view: to "all" of this one, or "holds", where parts of it lie outside and the user has not moved it. */
  #select(solution, fit = null, curves = true) {
    const { board, player } = this,
      { motion } = this.answer;
    this.solution = solution;
    this.fields.forget();
    this.#press();
    player.show(solution, motion, fit === "all", curves);
    if (fit !== "all" && !board.holds(player.shown.used.filter(Boolean).flatMap(({ a, b, c, d }) => [a, b, c, d]))) {
      if (fit && !board.moved) board.fit();
      else board.tell(OUTSIDE);
    }
    this.#showNumbers();
    this.#showOthers();
    this.layers.select(solution);
    this.driving.select(solution);
    this.preview.soon();
  }

  #showOthers() {
    const { motion, reply } = this.answer ?? {},
      faint = $("overlay").checked && reply ? reply.solutions : this.pinned,
      background = faint.filter((candidate) => candidate !== this.solution);
    this.board.showOthers(background.map((candidate) => trajectory(candidate, motion)));
  }

  /** `again`: the same solution, so that what the last export said stays. */
  #showNumbers(again = false) {
    const { solution, answer } = this,
      rows = worstRows(fitOf(solution, answer.motion), answer.motion, answer.size);
    $("joints-note").textContent = rows.length ? `Largest errors: ${worstWords(rows, answer.motion)}.` : "";
    $("numbers").replaceChildren(...numberBlocks(solution, answer));
    if (!again) note("");
  }

  /** The request for a file of the selected linkage; its parts have the sizes of its layers. */
  #fileRequest(format) {
    const { solution, layers } = this,
      { request, within = request, motion } = this.answer,
      { shown } = this.driving,
      common = { linkage: solution, format, length_unit: motion.unit };
    if (within !== request && ["json", "csv"].includes(format))
      return { route: "/v2/function/export", request, ...common };
    const solids = { fit: $("parts-fit").value, allow_collisions: $("parts-collisions").checked },
      ofParts = [...OF_PARTS, "mjcf", "plates"].includes(format);
    const driven = shown && WITH_DRIVE.includes(format);
    return {
      request: within,
      ...common,
      ...(ofParts && { assembly: layers.options(solution, motion), solids }),
      ...(driven && { drive: shown }),
    };
  }

  #file(format) {
    const { route = "/v2/export", ...request } = this.#fileRequest(format);
    return ask(route, request);
  }

  async #save(format) {
    const name = `linkage-${this.solution.rank ?? "by-hand"}.${ENDINGS[format] ?? format}`;
    note(`Making ${format.toUpperCase()}…`);
    try {
      download(await (await this.#file(format)).blob(), name);
      note(`Saved ${name}.`);
    } catch (error) {
      note(error.message);
    }
  }
}
