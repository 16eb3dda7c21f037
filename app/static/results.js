// The solutions of an answer: the list, the search's error over time, and the numbers and files of the selected one.

import { chart, redrawOn } from "./charts.js";
import { text, thumbnail } from "./drawing.js";
import { Linkage } from "./kinematics.js";
import { placeOf, wantsPlaces } from "./motion.js";
import { Player } from "./player.js";
import { ask, download } from "./service.js";
import { $ } from "./shell.js";
import { studyRows } from "./studies.js";
import { passing } from "./timing.js";
import { judged, mark, reasons } from "./verdict.js";

const RAD = Math.PI / 180;
const CARDS = ["results", "trace-card", "curves-card", "numbers-card", "player"];
const FAMILIES = {
  crank_rocker: "crank-rocker", double_crank: "double-crank", rocker_crank: "rocker-crank",
  double_rocker: "double-rocker", triple_rocker: "triple-rocker", change_point: "change point",
};
const ENDINGS = { mjcf: "xml", plates: "plates.dxf", pylinkage: "pylinkage.json" };
const ENDS = { tolerance: "tolerance reached", converged: "no further improvement found", budget: "time limit reached" };

/** An error with its unit; "rounding" where it is below 1e-12 of the motion's size. */
function errorText(value, size, unit = "") {
  if (value === null) return null;
  return value < 1e-12 * size ? "rounding" : `${text(value, 3)}${unit}`;
}

/** Rows [name, value] of a solution, its lengths and angles with `digits` digits. */
function numberRows(solution, digits) {
  const { links, mount, errors, rounded } = solution;
  const number = (value) => text(value, digits);
  const rows = [
    ["Crank", number(links.crank)], ["Coupler", number(links.coupler)], ["Rocker", number(links.rocker)], ["Ground", number(links.ground)],
    ["Branch", solution.branch > 0 ? "+1" : "−1"], ["Start angle", `${number(solution.start_angle)}°`],
  ];
  if (solution.body_offset !== null) rows.push(["Body offset", `${number(solution.body_offset)}°`]);
  if (mount) {
    rows.push(
      ["Pivot A", mount.pivot_a.map(number).join(", ")],
      ["Pivot B", mount.pivot_b.map(number).join(", ")],
      ["Ground angle", `${number(mount.ground_angle)}°`],
      ["Coupler point", `${number(mount.coupler_point.radius)} at ${number(mount.coupler_point.angle)}°`],
    );
  }
  if (errors.rotation_max !== null) rows.push(["Rotation error, largest", `${text(errors.rotation_max, 4)}°`]);
  if (errors.position_max !== null) rows.push(["Position error, largest", text(errors.position_max, 4)]);
  if (Number.isFinite(solution.excursion)) rows.push(["Way between samples", `${text(solution.excursion, 3)} × distance`]);
  rows.push(["Transmission", `${text(solution.transmission_angle_min, 5)}°`]);
  if (solution.transmission_angle_min_turn !== null) rows.push(["Transmission, whole turn", `${text(solution.transmission_angle_min_turn, 5)}°`]);
  if (rounded?.closes) {
    const { position_rms: position, rotation_rms: rotation } = rounded.errors;
    rows.push(
      ["Rounded links", ["crank", "coupler", "rocker", "ground"].map((name) => text(rounded.links[name], 8)).join(", ")],
      ["Error when rounded", position === null ? `${text(rotation, 3)}°` : text(position, 3)],
    );
  } else if (rounded) rows.push(["Rounded links", "none closes within the limits"]);
  return [...rows, ...studyRows(solution)];
}

/** An element with a class and text. */
function element(name, className, content = "") {
  return Object.assign(document.createElement(name), { className, textContent: content });
}

/** A sign, which screen readers skip, and what it stands for. */
function signed(name, className, sign, words) {
  const made = element(name, className);
  const symbol = element("span", "sign", sign);
  symbol.setAttribute("aria-hidden", "true");
  made.append(symbol, ` ${words}`);
  return made;
}

/** What was judged of a solution, and all reasons. */
function verdictBlock(verdict, motion) {
  const block = element("div", "judged");
  block.append(element("h3", "", "Verdict"));
  const list = document.createElement("dl");
  for (const [name, good, words] of judged(verdict, motion)) {
    const poor = name === "Buildable" || name === "Tolerance" ? "poor" : "bad";
    list.append(element("dt", "", name), signed("dd", good ? "good" : poor, good ? "✓" : poor === "bad" ? "✕" : "!", words));
  }
  block.append(list);
  const sentences = reasons(verdict);
  if (sentences.length) {
    const reasonList = document.createElement("ul");
    reasonList.append(...sentences.map((one) => element("li", "", one)));
    block.append(reasonList);
  }
  return block;
}

/** The crank angles that a solution brings along, in the order in which the samples are passed. */
function crankBlock(solution, motion) {
  const block = document.createElement("details"), { order } = passing(solution, motion, false);
  const table = document.createElement("table");
  for (const k of order) {
    const row = table.insertRow();
    row.append(Object.assign(element("th", "", `Sample ${k + 1}`), { scope: "row" }));
    row.insertCell().textContent = `${text(solution.crank_angle[k], 8)}°`;
  }
  block.append(element("summary", "", "Crank angles at the samples"), table);
  return block;
}

function note(sentence) {
  $("export-note").textContent = sentence;
}

/** Puts `content` on the clipboard and notes `done`; where the browser forbids it, notes the content itself. */
export async function copy(content, done) {
  try {
    await navigator.clipboard.writeText(content);
    note(done);
  } catch { note(content); }
}

export class Results {
  constructor(board) {
    Object.assign(this, { answer: null, solution: null, rank: 0, player: new Player(board) });
    $("copy").addEventListener("click", () => copy(this.#rows().map((row) => row.join("\t")).join("\n"), "The numbers are copied."));
    for (const button of document.querySelectorAll("[data-format]")) button.addEventListener("click", () => this.#save(button.dataset.format));
    $("print").addEventListener("click", () => print());
    redrawOn($("trace"), () => this.#drawTrace());
  }

  /** Shows an answer {request, reply, motion}, or with null none; a further answer to the same request keeps the selection. */
  show(answer, further = false) {
    this.answer = answer;
    if (!further) this.rank = 0;
    const solutions = answer?.reply.solutions ?? [];
    for (const id of CARDS) $(id).hidden = !solutions.length;
    $("solutions").replaceChildren();
    if (!solutions.length) {
      this.solution = null;
      this.player.clear();
      return;
    }
    const { report } = answer.reply;
    $("solutions").append(...solutions.map((solution, k) => this.#makeItem(solution, k)));
    $("results-note").textContent = `rms errors of rotation and position · ${Math.round(report.elapsed_ms.total)} ms`;
    $("trace-note").textContent = [`Search ended: ${ENDS[report.stopped_by]}.`, ...report.notes.map((sentence) => `Note: ${sentence}.`)].join(" ");
    this.#select(Math.min(this.rank, solutions.length - 1));
    this.#drawTrace();
  }

  /** The numbers to be copied, with all digits. */
  #rows() {
    const { verdict, crank_angle } = this.solution, rows = numberRows(this.solution, 17);
    if (crank_angle) rows.push(["Crank angles", crank_angle.map((angle) => `${text(angle, 17)}°`).join(", ")]);
    if (verdict) rows.push(["Verdict", mark(verdict).text], ...reasons(verdict).map((one) => ["Reason", one]));
    return rows;
  }

  #makeItem(solution, k) {
    const { motion, reply } = this.answer, linkage = new Linkage(solution);
    const targets = wantsPlaces(motion) ? motion.poses.map(placeOf).filter(Boolean) : [];
    const { sense, low, high } = passing(solution, motion, linkage.turnsFully);
    const button = document.createElement("button");
    button.type = "button";
    button.append(thumbnail(linkage, [sense * low * RAD, sense * high * RAD], targets));
    const name = document.createElement("span");
    name.className = "name";
    name.textContent = `${solution.rank}. ${FAMILIES[solution.family] ?? solution.family}`;
    const facts = document.createElement("dl");
    const rows = [
      ["rotation", errorText(solution.errors.rotation_rms, 57, "°")],
      ["position", errorText(solution.errors.position_rms, reply.report.length_scale ?? 1)],
      ["transmission", `${text(solution.transmission_angle_min, 3)}°`],
    ];
    for (const [term, value] of rows) {
      if (value === null) continue;
      facts.append(Object.assign(document.createElement("dt"), { textContent: term }), Object.assign(document.createElement("dd"), { textContent: value }));
    }
    button.append(name, facts);
    const verdict = mark(solution.verdict);
    if (verdict) button.append(signed("span", `verdict ${verdict.kind}`, verdict.sign, verdict.text));
    button.addEventListener("click", () => this.#select(k));
    const item = document.createElement("li");
    item.append(button);
    return item;
  }

  #select(k) {
    this.rank = k;
    this.solution = this.answer.reply.solutions[k];
    [...$("solutions").children].forEach((item, j) => item.firstChild.setAttribute("aria-pressed", String(j === k)));
    this.player.show(this.solution, this.answer.motion);
    this.#showNumbers();
  }

  #showNumbers() {
    const table = document.createElement("table");
    for (const [name, value] of numberRows(this.solution, 8)) {
      const row = table.insertRow();
      row.append(Object.assign(document.createElement("th"), { scope: "row", textContent: name }));
      row.insertCell().textContent = value;
    }
    const { verdict, crank_angle } = this.solution, { motion } = this.answer;
    $("numbers").replaceChildren(...(verdict ? [verdictBlock(verdict, motion)] : []), table, ...(crank_angle ? [crankBlock(this.solution, motion)] : []));
    if (this.solution.determination.ill_posed) {
      $("numbers").append(Object.assign(document.createElement("p"), { className: "note", textContent: "Clearly different linkages make this motion about equally well: the motion does not determine the link lengths." }));
    }
    note("");
  }

  #drawTrace() {
    const box = $("trace");
    if (!this.answer || $("trace-card").hidden) return;
    const { report } = this.answer.reply;
    const trace = report.trace.map(([ms, objective]) => [ms, Math.max(objective, 1e-17)]);
    if (!trace.length) { box.replaceChildren(); return; }
    trace.push([Math.max(report.elapsed_ms.total, trace.at(-1)[0] * 1.001), trace.at(-1)[1]]);
    box.setAttribute("aria-label", `Best error after each round: ${report.trace.slice(-6).map(([ms, objective]) => `${text(objective, 2)} after ${text(ms, 3)} ms`).join(", ")}`);
    chart(box, {
      x: trace.map(([ms]) => ms), height: innerWidth <= 900 ? 170 : Math.max(170, Math.min(box.clientHeight, 360)), degreesX: false, logY: true, xName: " ms",
      series: [{ values: trace.map(([, objective]) => objective), colour: "accent", steps: true, size: 5 }],
    });
  }

  async #save(format) {
    const { solution, answer: { request } } = this;
    note(`Making ${format.toUpperCase()}…`);
    try {
      const sizes = ["hole", "width"].map((name) => [name, $(`plate-${name}`).valueAsNumber]).filter(([, value]) => value > 0);
      const plates = sizes.length && format === "plates" ? { plates: Object.fromEntries(sizes) } : {};
      const reply = await ask("/v1/export", { request, solution, format, length_unit: $("length-unit").value, ...plates });
      const name = `linkage-${solution.rank}.${ENDINGS[format] ?? format}`;
      download(await reply.blob(), name);
      note(`Saved ${name}.`);
    } catch (error) { note(error.message); }
  }
}
