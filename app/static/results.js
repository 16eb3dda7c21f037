// The solutions of an answer: the list, the search's error over time, and the numbers and files of the selected one.

import { card, grouped, nameOf, sign, sorted } from "./cards.js";
import { chart, redrawOn } from "./charts.js";
import { button, element, namedRows, signed, text } from "./drawing.js";
import { Driving } from "./driving.js";
import { driveName, drivePlaces, driveTurns } from "./drive.js";
import {
  alike,
  errorText,
  fitOf,
  guideRows,
  roundedLinks,
  roundedText,
  settled,
  worstRows,
  worstWords,
} from "./fit.js";
import { assessed, fromJoints } from "./hand.js";
import { JointFields } from "./joints.js";
import { Layers } from "./layers.js";
import { itemOf, placesOf, unitOf } from "./motion.js";
import { Player, trajectory } from "./player.js";
import { ask, download } from "./service.js";
import { $, capital, copy } from "./shell.js";
import { studyRows } from "./studies.js";
import { passing } from "./timing.js";
import { judged, limitName, mark, plainNote, reasons } from "./verdict.js";

const CARDS = ["results", "trace-card", "curves-card", "numbers-card", "files-card", "player"];
const LINKS = ["crank", "coupler", "rocker", "ground"];
const ENDINGS = { mjcf: "xml", plates: "plates.dxf", pylinkage: "pylinkage.json", stl: "stl.zip", parts: "parts.csv" };
const OF_PARTS = ["step", "3mf", "stl", "urdf", "sdf", "parts"];
const DIGITS = 4; // of numbers that are shown; their titles and copies have more
const ENDS = { tolerance: "tolerance reached", converged: "no further improvement found", budget: "the time was up" };
const REST_MS = 120; // without a further drag, after which the curves are drawn anew
const NEAR = 2.5; // views of the motion, or of the selected linkage if that needs more, that further solutions may widen the view to

/** Rows [name, value] of a solution, its lengths and angles with `digits` digits. */
function numberRows(solution, { motion, size }, digits) {
  const { links, mount, rounded } = solution,
    unit = unitOf(motion),
    { places, turns, worst } = fitOf(solution, motion);
  const number = (value) => text(value, digits),
    place = (value) => number(settled(value, size)),
    length = (value) => `${place(value)} ${unit}`;
  const rows = links
    ? LINKS.map((name) => [capital(name), length(links[name])])
    : guideRows(solution, number, place, length);
  rows.push(["Branch", solution.branch > 0 ? "+1" : "−1"]);
  if (links) rows.push(["Start angle", `${number(solution.start_angle)}°`]);
  else
    rows.push([
      `Drive at the first ${itemOf(motion)}`,
      driveTurns(solution) ? `${number(solution.start)}°` : length(solution.start),
    ]);
  if (Number.isFinite(solution.body_offset)) rows.push(["Body offset", `${number(solution.body_offset)}°`]);
  if (mount) {
    rows.push(
      ["Pivot A", `${mount.pivot_a.map(place).join(", ")} ${unit}`],
      ["Pivot B", `${mount.pivot_b.map(place).join(", ")} ${unit}`],
      ["Ground angle", `${number(settled(mount.ground_angle, 57))}°`],
    );
    rows.push([
      "Coupler point",
      `${length(mount.coupler_point_polar.radius)} at ${number(mount.coupler_point_polar.angle)}°`,
    ]);
  }
  const at = (k, error) => (error === "rounding" ? error : `${error} at ${itemOf(motion)} ${k + 1}`);
  if (worst.turn !== null)
    rows.push(["Angle error, largest", at(worst.turn, errorText(Math.abs(turns[worst.turn]), 57, "°"))]);
  if (worst.place !== null)
    rows.push(["Position error, largest", at(worst.place, errorText(places[worst.place], size, ` ${unit}`))]);
  if (solution.errors.rotation_rms !== null)
    rows.push(["Angle error, rms", errorText(solution.errors.rotation_rms, 57, "°")]);
  if (solution.errors.position_rms !== null)
    rows.push(["Position error, rms", errorText(solution.errors.position_rms, size, ` ${unit}`)]);
  if (Number.isFinite(solution.size)) rows.push(["Size", `${number(solution.size)} × motion`]);
  if (Number.isFinite(solution.excursion))
    rows.push([`Detour between ${itemOf(motion)}s`, `${text(solution.excursion, 3)} × distance`]);
  rows.push(["Transmission", `${text(solution.transmission_angle_min, DIGITS)}°`]);
  if (Number.isFinite(solution.arm_min)) rows.push(["Moment arm, least", length(solution.arm_min)]);
  if (Number.isFinite(solution.transmission_angle_min_turn))
    rows.push(["Transmission, whole turn", `${text(solution.transmission_angle_min_turn, DIGITS)}°`]);
  const held = solution.determination?.active_limits ?? [];
  if (held.length) rows.push(["Limited by", held.map(limitName).join(", ")]);
  const error = roundedText(solution, size, ` ${unit}`);
  if (error && rounded.closes)
    rows.push([
      "Rounded links",
      `${roundedLinks(rounded)
        .map(([name, one]) => `${name} ${number(one)}`)
        .join(", ")} ${unit}`,
    ]);
  if (error) rows.push(["Error when rounded", error]);
  return [...rows, ...studyRows(solution, unit)];
}

function verdictBlock(solution, motion) {
  const { verdict } = solution;
  const block = element("div", "judged");
  block.append(element("h3", "", "Verdict"));
  const list = document.createElement("dl");
  for (const [name, good, words] of judged(
    verdict,
    motion,
    itemOf(motion),
    driveName(solution),
    driveTurns(solution),
  )) {
    const poor = ["Practical limits", "Tolerance", "Layers"].includes(name) ? "poor" : "bad";
    list.append(
      element("dt", "", name),
      signed("dd", good ? "good" : poor, good ? "✓" : poor === "bad" ? "✕" : "!", words),
    );
  }
  block.append(list);
  const sentences = reasons(verdict, itemOf(motion));
  if (sentences.length) {
    const reasonList = document.createElement("ul");
    reasonList.append(...sentences.map((one) => element("li", "", one)));
    block.append(reasonList);
  }
  return block;
}

/** The crank angles that a solution brings along, in the order in which the samples are passed. */
function crankBlock(solution, motion) {
  const block = document.createElement("details"),
    { order } = passing(solution, motion, false);
  const table = namedRows(
    order.map((k) => [
      `${capital(itemOf(motion))} ${k + 1}`,
      `${text(drivePlaces(solution)[k], DIGITS)}${driveTurns(solution) ? "°" : ` ${motion.unit}`}`,
    ]),
  );
  block.append(
    element(
      "summary",
      "",
      driveTurns(solution)
        ? `Crank angles at the ${itemOf(motion)}s`
        : `Travel of the ${solution.driver} at the ${itemOf(motion)}s`,
    ),
    table,
  );
  return block;
}

/** What can be done with a linkage that was changed by hand. */
function handBlock({ links }) {
  const block = element("div", "judged"),
    group = element("div", "group wrap"),
    more =
      " The service can refine it to the nearest optimum from just there, or search anew with both pivots near where you put them.";
  const choices = links
    ? [
        ["refine-here", "Refine from there", "refinehere"],
        ["search-near", "Search near here", "searchnear"],
      ]
    : [];
  for (const [id, words, event] of choices)
    group.append(
      Object.assign(
        button(words, () => document.dispatchEvent(new Event(event))),
        { id },
      ),
    );
  block.append(
    element(
      "p",
      "note",
      `Changed by hand: its errors are computed in this page, and nothing is judged.${links ? more : ""}`,
    ),
    group,
  );
  return block;
}

export function note(sentence) {
  $("export-note").textContent = sentence;
}

const isHand = (solution) => solution.source === "hand";

export class Results {
  /** `keep(kind)` makes what there is before a joint is moved a step of undo; `changed()` is called when the user has moved one or picked a card. */
  constructor(board, keep, changed) {
    Object.assign(this, {
      keep,
      changed,
      answer: null,
      solution: null,
      board,
      player: new Player(board),
      picked: false,
      pinned: [],
    });
    this.layers = new Layers(
      board,
      (degrees) => {
        this.player.stop();
        this.player.goto(degrees);
      },
      (solution) => this.#judgedAnew(solution),
    );
    this.driving = new Driving(board, this.player);
    this.fields = new JointFields(
      board,
      (name, place) => this.drag(name, place, null),
      () => this.player.stop(),
    );
    $("copy").addEventListener("click", () =>
      copy(
        this.#rows()
          .map((row) => row.join("\t"))
          .join("\n"),
        "The numbers are copied.",
        note,
      ),
    );
    for (const one of document.querySelectorAll("[data-format]"))
      one.addEventListener("click", () => this.#save(one.dataset.format));
    $("sort").addEventListener("change", () => this.#list());
    $("drive-find").addEventListener("click", () => {
      this.picked = true;
    });
    $("overlay").addEventListener("change", () => this.#showOthers());
    board.seen.push(() => this.#movePictures());
    redrawOn($("trace"), () => this.#drawTrace());
    redrawOn($("solutions"), () => this.answer && this.#list());
  }

  /** Shows an answer {request, reply, motion}, or with null none; a further answer to the same request keeps the card that was picked. */
  show(answer, further = false) {
    if (!further) this.picked = false;
    // the view stays for further answers, and where the user has moved it to look at the linkages of this request
    const stays =
      further ||
      (this.board.moved && this.answer && JSON.stringify(this.answer.request) === JSON.stringify(answer?.request));
    const before = this.picked ? this.solution : null,
      solutions = answer?.reply.solutions ?? [];
    let held = before && solutions.find((one) => alike(one, before));
    // a further answer to the same question need not have the linkage that the user holds
    if (before && !held && this.answer === answer)
      solutions.push((held = Object.assign(before, { rank: solutions.length + 1 })));
    this.answer = answer;
    for (const id of CARDS) $(id).hidden = !solutions.length;
    if (!solutions.length) {
      for (const one of [this.layers, this.driving]) {
        one.show(null);
        one.select(null);
      }
      this.solution = null;
      $("solutions").replaceChildren();
      this.pinned = [];
      this.board.showOthers([]);
      this.player.clear();
      return;
    }
    const { report } = answer.reply;
    answer.size = report.length_scale ?? 1;
    $("results-note").textContent =
      `largest errors, at ${itemOf(answer.motion)} (no.) · ${answer.live ? "moved with the motion" : answer.stored ? "searched beforehand" : `${Math.round(report.elapsed_ms.total)} ms`}`;
    $("trace-note").textContent = [
      answer.live ? "" : `${answer.refined ? "Descent" : "Search"} ended: ${ENDS[report.stopped_by]}.`,
      ...report.notes.map((one) => plainNote(one, itemOf(answer.motion))),
    ].join(" ");
    this.solution = held ?? solutions[0];
    this.#list();
    this.layers.show(answer);
    this.driving.show(answer);
    this.#select(this.solution, stays ? "holds" : "all", false);
    // the linkage first: charts take as long to draw as all the rest
    clearTimeout(this.charts);
    this.charts = setTimeout(() => {
      this.player.drawCurves();
      this.#drawTrace();
    });
  }

  /** Selects the solution that is like `wanted`; adds `wanted`, with errors computed here, where there is none. */
  choose(wanted) {
    const { motion, reply } = this.answer;
    let found = reply.solutions.find((one) => one === wanted) ?? reply.solutions.find((one) => alike(one, wanted));
    if (!found) {
      found = {
        ...assessed(
          { ...wanted, verdict: null, rank: null, determination: { ill_posed: false, active_limits: [] } },
          motion,
        ).solution,
        source: "link",
      };
      reply.solutions.push(found);
    }
    this.picked = true;
    this.#select(found, "holds");
    this.#list();
  }

  /** Shows a linkage that is being moved with the motion; the rest of the page is of the one before until that has come to rest. */
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

  /** What undo brings back: the linkage changed by hand, the one selected, and where its crank stands. */
  get state() {
    return (
      this.solution && {
        hand: this.answer.reply.solutions.find(isHand),
        solution: this.solution,
        travel: this.player.travel,
      }
    );
  }

  restore({ hand, solution, travel }) {
    const { reply } = this.answer,
      others = reply.solutions.filter((one) => !isHand(one)),
      all = hand ? [...others, hand] : others;
    reply.solutions = all;
    this.#select(all.find((one) => one === solution) ?? all.find((one) => alike(one, solution)) ?? all[0]);
    this.player.goto(travel);
    this.#list();
  }

  /**
   * A joint of the selected linkage is dragged, or typed, to a place: its errors are computed anew. Drags of one `kind` are one step
   * of undo. Returns what hinders it, or null.
   */
  drag(name, place, kind = `joint ${name}`) {
    const { motion, reply } = this.answer ?? {};
    if (!(this.solution?.mount || this.solution?.guides) || !this.board.joints)
      return "without positions a linkage has no place.";
    this.player.stop();
    const joints = { ...this.board.joints, [name]: place },
      made = fromJoints(joints, this.player.travel, this.solution);
    if (!made) return "two joints would coincide there.";
    this.keep(kind);
    const { solution, shift, closes } = assessed(made, motion),
      travel = this.player.travel - shift;
    const old = reply.solutions.findIndex(isHand);
    if (old >= 0) reply.solutions[old] = solution;
    else reply.solutions.push(solution);
    Object.assign(this, { solution, picked: true });
    this.player.show(solution, motion, false, false);
    this.player.goto(travel);
    this.layers.select(solution);
    this.driving.select(solution);
    clearTimeout(this.later);
    this.later = setTimeout(() => this.player.drawCurves(), REST_MS);
    this.#showNumbers();
    this.#list();
    this.changed();
    this.board.tell(
      closes
        ? [
            errorText(solution.errors.position_max, 1e-300, ` ${motion.unit}`),
            errorText(solution.errors.rotation_max, 1e-300, "°"),
          ]
            .filter(Boolean)
            .join(", ")
        : `does not close at every ${itemOf(motion)}`,
    );
    return null;
  }

  /** The numbers to be copied, with all digits. */
  #rows() {
    const { verdict } = this.solution,
      item = itemOf(this.answer.motion),
      rows = numberRows(this.solution, this.answer, 17),
      places = drivePlaces(this.solution),
      turns = driveTurns(this.solution);
    if (places)
      rows.push([
        turns ? "Crank angles" : "Travel",
        places.map((place) => `${text(place, 17)}${turns ? "°" : ""}`).join(", "),
      ]);
    if (verdict)
      rows.push(["Verdict", mark(verdict, item).text], ...reasons(verdict, item).map((one) => ["Reason", one]));
    return rows;
  }

  #list() {
    const { motion, reply, size } = this.answer,
      active = $("solutions").contains(document.activeElement);
    const groups = grouped(sorted(reply.solutions, $("sort").value)),
      choose = (solution) => {
        this.picked = true;
        this.#select(solution);
        this.changed();
      };
    this.pinned = this.pinned.map((one) => reply.solutions.find((other) => alike(one, other))).filter(Boolean);
    $("solutions").replaceChildren(
      ...groups.flatMap(([kind, solutions]) => {
        const list = document.createElement("ol");
        list.append(
          ...solutions.map((solution) =>
            card(
              solution,
              motion,
              size,
              this.pinned.includes(solution),
              () => choose(solution),
              (on) => this.#compare(solution, on),
            ),
          ),
        );
        return groups.length > 1 ? [element("h3", "", kind), list] : [list];
      }),
    );
    this.cards = groups.flatMap(([, solutions]) => solutions);
    this.share = null;
    this.#movePictures();
    this.#showCompared();
    this.#press();
    if (active) $("solutions").querySelector("[aria-pressed=true]")?.focus({ preventScroll: true });
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
    this.pinned = [...this.pinned.filter((one) => one !== solution), ...(on ? [solution] : [])].slice(-2);
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
    const columns = pinned.map(
      (one) =>
        new Map([
          ...numberRows(one, answer, DIGITS),
          ["Verdict", mark(one.verdict, itemOf(answer.motion))?.text ?? "not judged"],
        ]),
    );
    const table = document.createElement("table"),
      head = table.createTHead().insertRow(),
      body = table.createTBody();
    head.append(
      element("td", ""),
      ...pinned.map((one) => Object.assign(element("th", "", nameOf(one)), { scope: "col" })),
    );
    for (const name of columns[0].keys()) {
      if (columns[1].has(name))
        body
          .insertRow()
          .append(
            Object.assign(element("th", "", name), { scope: "row" }),
            ...columns.map((rows) => element("td", "", rows.get(name))),
          );
    }
    host.replaceChildren(element("h3", "", "Compared"), table);
  }

  /** The verdict of a solution has its layers: its card and, where it is selected, its numbers say so. */
  #judgedAnew(solution) {
    const place = this.cards?.indexOf(solution) ?? -1;
    const shown = $("solutions").querySelectorAll("li")[place]?.querySelector(".verdict"),
      { className, childNodes } = sign(solution.verdict, this.answer.motion);
    if (shown) {
      shown.className = className;
      shown.replaceChildren(...childNodes);
    }
    if (solution === this.solution) this.#showNumbers(true);
  }

  #press() {
    [...$("solutions").querySelectorAll("li")].forEach((item, k) =>
      item.firstChild.setAttribute("aria-pressed", String(this.cards[k] === this.solution)),
    );
  }

  /** `fit` the view: "all" solutions, or "holds", where parts of this one lie outside and the user has not moved it. */
  #select(solution, fit = null, curves = true) {
    const { motion, reply } = this.answer;
    this.solution = solution;
    this.fields.forget();
    this.#press();
    this.player.show(solution, motion, fit === "all", curves);
    if (fit === "all") this.#fitAll(reply.solutions);
    else if (!this.board.holds(this.player.shown.used.filter(Boolean).flatMap((j) => [j.a, j.b, j.d, j.c]))) {
      if (fit && !this.board.moved) this.board.fit();
      else this.board.tell("Parts lie outside the view: Fit shows all");
    }
    this.#showNumbers();
    this.#showOthers();
    this.layers.select(solution);
    this.driving.select(solution);
  }

  /** Fits the selected solution, and those beside it that leave the motion large enough to be looked at. */
  #fitAll(solutions) {
    const {
        board,
        answer: { motion },
      } = this,
      { width, height } = board.view,
      jointsOf = (used) =>
        used
          .filter(Boolean)
          .flatMap((j) => [j.a, j.b, j.c, j.d, j.p])
          .filter(Boolean);
    const extent = (points) =>
      Math.max(
        ...[width, height].map((pixels, i) => {
          const all = points.map((p) => p[i]);
          return (Math.max(...all) - Math.min(...all)) / pixels;
        }),
      );
    const own = jointsOf(this.player.shown.used),
      wanted = placesOf(motion);
    if (!own.length) return;
    const most = Math.max(extent([...own, ...wanted]), NEAR * extent(wanted.length > 1 ? wanted : own)),
      more = [];
    for (const solution of solutions.slice(0, 12)) {
      const points = jointsOf(fitOf(solution, motion).at);
      if (points.length && extent([...own, ...wanted, ...more, ...points]) <= most) more.push(...points);
    }
    board.fit(more);
  }

  #showOthers() {
    const { motion, reply } = this.answer ?? {};
    const faint = $("overlay").checked && reply ? reply.solutions : this.pinned;
    this.board.showOthers(faint.filter((one) => one !== this.solution).map((one) => trajectory(one, motion)));
  }

  /** `again`: the same solution, so that what the last export said stays. */
  #showNumbers(again = false) {
    const rows = worstRows(fitOf(this.solution, this.answer.motion), this.answer.motion, this.answer.size);
    $("joints-note").textContent = rows.length ? `Off by at most ${worstWords(rows, this.answer.motion)}.` : "";
    const { verdict, source } = this.solution,
      { motion } = this.answer,
      table = namedRows(numberRows(this.solution, this.answer, DIGITS)),
      parts = [table];
    numberRows(this.solution, this.answer, 8).forEach(([, value], k) => {
      table.rows[k].cells[1].title = value;
    });
    if (verdict) parts.unshift(verdictBlock(this.solution, motion));
    else if (source === "hand") parts.unshift(handBlock(this.solution));
    if (drivePlaces(this.solution)) parts.push(crankBlock(this.solution, motion));
    if (this.solution.determination?.ill_posed)
      parts.push(
        element(
          "p",
          "note",
          "Clearly different linkages make this motion about equally well: the motion does not determine the link lengths.",
        ),
      );
    $("numbers").replaceChildren(...parts);
    // where something slides: joints of these files turn
    for (const format of ["pylinkage", "urdf", "sdf"])
      document.querySelector(`[data-format="${format}"]`).disabled = !this.solution.links;
    if (!again) note("");
  }

  #drawTrace() {
    const box = $("trace");
    if (!this.answer || !box.clientWidth) return;
    const { report } = this.answer.reply;
    const trace = report.trace.map(([ms, objective]) => [ms, Math.max(objective, 1e-17)]);
    if (!trace.length) {
      box.replaceChildren();
      return;
    }
    trace.push([Math.max(report.elapsed_ms.total, trace.at(-1)[0] * 1.001), trace.at(-1)[1]]);
    box.setAttribute(
      "aria-label",
      `Best error after each round: ${report.trace
        .slice(-6)
        .map(([ms, objective]) => `${text(objective, 2)} after ${text(ms, 3)} ms`)
        .join(", ")}`,
    );
    chart(box, {
      x: trace.map(([ms]) => ms),
      height: 170,
      degreesX: false,
      logY: true,
      xName: " ms",
      series: [{ values: trace.map(([, objective]) => objective), colour: "accent", steps: true, size: 5 }],
    });
  }

  /** A file of the selected linkage; its parts have the sizes of its layers. */
  #file(format) {
    const {
      solution,
      answer: { request, motion },
    } = this;
    const solids = { fit: $("parts-fit").value, allow_collisions: $("parts-collisions").checked };
    const parts = [...OF_PARTS, "mjcf", "plates"].includes(format)
      ? { assembly: this.layers.options(solution, motion), solids }
      : {};
    // what slides is in no URDF or SDF
    const driven = [
      "dxf",
      "csv",
      "svg",
      "mjcf",
      "plates",
      ...OF_PARTS.filter((one) => this.driving.shown?.kind !== "actuator" || !["urdf", "sdf"].includes(one)),
    ];
    const drive = this.driving.shown && driven.includes(format) ? { drive: this.driving.shown } : {};
    return ask("/v2/export", { request, linkage: solution, format, length_unit: motion.unit, ...parts, ...drive });
  }

  /** The parts list of the selected linkage, a row a part by column; null where its layers are not free. */
  async partsList() {
    const status = this.solution?.verdict?.assembly?.status;
    if (!status || status === "blocked") return null;
    const [head, ...rows] = (await (await this.#file("parts")).text())
      .trim()
      .split("\r\n")
      .map((line) => line.split(","));
    return rows.map((row) => Object.fromEntries(row.map((cell, k) => [head[k], cell])));
  }

  async #save(format) {
    const { solution } = this;
    note(`Making ${format.toUpperCase()}…`);
    try {
      const reply = await this.#file(format);
      const name = `linkage-${solution.rank ?? "by-hand"}.${ENDINGS[format] ?? format}`;
      download(await reply.blob(), name);
      note(`Saved ${name}.`);
    } catch (error) {
      note(error.message);
    }
  }
}
