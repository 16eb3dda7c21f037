// The page of function generation: a function chosen, drawn or typed; the linkages whose rocker turns so; their error.

import { redrawOn, titledChart } from "./charts.js";
import { LinkageShape, View, make, put, text, thumbnail } from "./drawing.js";
import { Linkage } from "./kinematics.js";
import { ask, download } from "./service.js";
import { $, say, startScenes, startTheme } from "./shell.js";
import { mark, reasons } from "./verdict.js";

const RAD = Math.PI / 180;
const DRAWN = 41; // samples of a drawn curve
const PAD = { width: 320, height: 200, border: 8 };
const STATUS = {
  reached: "Solved: the best linkage makes the function to within rounding.",
  closest: "No linkage was found that makes exactly this function; these come closest.",
  infeasible: "No linkage was found within these limits. Loosen one of them.",
  unknown: "No linkage was found before the search was cut short, which proves nothing.",
};
const LINKS = ["crank", "coupler", "rocker", "ground"];

let drawn = []; // points [px, py] of the pad, from left to right
let answer = null; // {request, reply}
let shown = null; // the selected solution
let charts = []; // of its error
let running = null; // AbortController of the search that runs

// -- the question -----------------------------------------------------------------------------------------------------

const number = (id) => ($(id).value.trim() === "" ? null : Number($(id).value));

/** The drawn curve at even x, smoothed over its neighbours: [[x, y], ...] with both in 0 .. 1. */
function drawnTable() {
  if (drawn.length < 3) throw new Error("Draw the function from left to right first.");
  const first = drawn[0][0], last = drawn.at(-1)[0];
  let k = 1;
  const heights = Array.from({ length: DRAWN }, (_, n) => {
    const x = first + ((last - first) * n) / (DRAWN - 1);
    while (k < drawn.length - 1 && drawn[k][0] < x) k++;
    const [x0, y0] = drawn[k - 1], [x1, y1] = drawn[k];
    return 1 - (y0 + ((y1 - y0) * (x - x0)) / (x1 - x0)) / PAD.height;
  });
  const smooth = (values) => values.map((value, n) => (n && n < values.length - 1 ? (values[n - 1] + 2 * value + values[n + 1]) / 4 : value));
  return smooth(smooth(smooth(heights))).map((y, n) => [n / (DRAWN - 1), Number(y.toFixed(6))]);
}

function typedTable() {
  return $("table").value.split("\n").filter((line) => line.trim()).map((line, k) => {
    const cells = line.trim().split(/[\s,;]+/).map(Number);
    if (cells.length !== 2 || !cells.every(Number.isFinite)) throw new Error(`Line ${k + 1} of the table: wanted two numbers, x and y.`);
    return cells;
  });
}

function toRequest() {
  const name = $("name").value, wanted = { output_span: number("output-span") };
  if (name === "drawn") wanted.table = drawnTable();
  else if (name === "table") wanted.table = typedTable();
  else {
    Object.assign(wanted, { name, x: [number("x0"), number("x1")] });
    if (name === "power") wanted.exponent = number("exponent");
  }
  const limits = { family: $("family").value };
  if ($("practical").checked) limits.preset = "practical";
  if (number("transmission") !== null) limits.transmission_angle_min = number("transmission");
  if (number("ratio") !== null) limits.link_ratio_max = number("ratio");
  if (number("ground") !== null) limits.links = { ground: number("ground") };
  const request = { function: wanted, crank_span: number("crank-span"), objective: $("objective").value, limits, top: number("top"), curves: true };
  if ($("one-way").checked) request.one_way = true;
  if (number("round") !== null) request.round_to = number("round");
  return request;
}

function showFields() {
  const name = $("name").value, kinds = { name: !["drawn", "table"].includes(name), power: name === "power", drawn: name === "drawn", table: name === "table" };
  for (const block of document.querySelectorAll("[data-for]")) block.hidden = !kinds[block.dataset.for];
  for (const id of ["x0", "x1"]) $(id).disabled = !kinds.name;
  showRequest();
}

function showRequest() {
  if (!$("request").open) return;
  try { $("request-text").textContent = JSON.stringify(toRequest(), null, 1); } catch (error) { $("request-text").textContent = error.message; }
}

// -- the pad ----------------------------------------------------------------------------------------------------------

function startPad() {
  const pad = $("pad"), { width, height, border } = PAD;
  make("rect", { class: "frame", x: 0.5, y: 0.5, width: width - 1, height: height - 1 }, pad);
  const line = make("path", { class: "pen" }, pad);
  const trace = () => put(line, { d: drawn.length > 1 ? `M${drawn.map((point) => point.map((v) => v.toFixed(1)).join(" ")).join("L")}` : "" });
  const place = (event) => {
    const box = pad.getBoundingClientRect();
    const clip = (value, most) => Math.min(Math.max(value, border), most - border);
    return [clip(((event.clientX - box.left) / box.width) * width, width), clip(((event.clientY - box.top) / box.height) * height, height)];
  };
  pad.addEventListener("pointerdown", (event) => {
    pad.setPointerCapture(event.pointerId);
    drawn = [place(event)];
    trace();
  });
  pad.addEventListener("pointermove", (event) => {
    if (!pad.hasPointerCapture(event.pointerId)) return;
    const point = place(event);
    if (point[0] > drawn.at(-1)[0] + 0.5) drawn.push(point); // a function has one y for each x
    trace();
  });
  pad.addEventListener("pointerup", showRequest);
  $("pad-clear").addEventListener("click", () => { drawn = []; trace(); showRequest(); });
}

// -- the answer -------------------------------------------------------------------------------------------------------

function rows(solution) {
  const { errors, rounded } = solution;
  const list = LINKS.map((name) => [name[0].toUpperCase() + name.slice(1), text(solution.links[name], 8)]);
  list.push(["Branch", solution.branch > 0 ? "+1" : "−1"], ["Crank at the first x", `${text(solution.start_angle, 8)}°`], ["Output less rocker angle", `${text(solution.output_offset, 8)}°`]);
  list.push(["Largest error", `${text(errors.max, 4)}°`], ["Root mean square error", `${text(errors.rms, 4)}°`]);
  if (errors.max_y !== null) list.push(["Largest error in y", text(errors.max_y, 4)]);
  if (errors.alternations !== null) list.push(["Extremes as large, alternating", String(errors.alternations)]);
  list.push(["Family", solution.family.replaceAll("_", "-")], ["Transmission", `${text(solution.transmission_angle_min, 5)}°`]);
  if (solution.transmission_angle_min_turn !== null) list.push(["Transmission, whole turn", `${text(solution.transmission_angle_min_turn, 5)}°`]);
  if (rounded?.closes) list.push(["Rounded links", LINKS.map((name) => text(rounded.links[name], 8)).join(", ")], ["Largest error when rounded", `${text(rounded.errors.max, 4)}°`]);
  else if (rounded) list.push(["Rounded links", "do not close"]);
  return list;
}

function showNumbers() {
  const table = document.createElement("table");
  for (const [name, value] of rows(shown)) {
    const row = table.insertRow();
    row.append(Object.assign(document.createElement("th"), { scope: "row", textContent: name }));
    row.insertCell().textContent = value;
  }
  const told = reasons(shown.verdict).map((sentence) => Object.assign(document.createElement("p"), { className: "note", textContent: sentence }));
  $("numbers").replaceChildren(table, ...told);
}

function showLinkage() {
  const span = answer.request.crank_span * RAD, linkage = new Linkage({ ...shown, mount: null });
  const view = new View(640, 360), used = linkage.over(0, span, 120).filter(Boolean);
  $("canvas").replaceChildren();
  if (!used.length) return;
  view.fit([used[0].a, used[0].b, ...used.flatMap(({ c, d }) => [c, d])], 28);
  const arc = (key) => make("path", { class: "curve", d: used.map((joints, k) => `${k ? "L" : "M"}${view.at(joints[key]).map((v) => v.toFixed(2)).join(" ")}`).join("") }, $("canvas"));
  arc("d");
  arc("c");
  const shape = new LinkageShape($("canvas"));
  const move = () => {
    const share = Number($("slider").value), joints = linkage.at(share * span);
    shape.show(joints, view);
    const made = joints && (joints.rocker / RAD + shown.output_offset);
    const wrapped = made === null ? null : made - 360 * Math.round((made - wantedAt(share)) / 360);
    $("where").textContent = joints ? `${text(share * answer.request.crank_span, 4)}°, rocker ${text(wrapped, 5)}°` : "does not close here";
    for (const plot of charts) plot.mark(share * answer.request.crank_span);
  };
  $("slider").oninput = move;
  showCurves();
  move();
}

/** The wanted output at a share of the interval, between the samples in a straight line. */
function wantedAt(share) {
  const { input, output } = answer.reply, x = share * input.at(-1);
  const side = Math.sign(input.at(-1)), after = input.findIndex((value) => side * value >= side * x);
  const k = after < 0 ? input.length - 1 : Math.max(1, after);
  return output[k - 1] + ((output[k] - output[k - 1]) * (x - input[k - 1])) / (input[k] - input[k - 1]);
}

function showCurves() {
  if (!shown) return;
  const { input, error } = shown.error_curve, { x, y, output } = answer.reply;
  const turn = input.at(-1) < 0 ? (values) => values.slice().reverse() : (values) => values;
  $("curves").replaceChildren();
  charts = [titledChart($("curves"), "Error in degrees of the rocker", { x: turn(input), degreesY: true, series: [{ values: turn(error), colour: "accent" }] })];
  const range = (values) => Math.max(...values) - Math.min(...values);
  if (y && range(output)) {
    const unit = range(y) / range(output);
    charts.push(titledChart($("curves"), "Error in units of y", { x: turn(input), series: [{ values: turn(error.map((value) => value * unit)), colour: "path" }] }));
  }
  charts.push(titledChart($("curves"), "Wanted angle of the rocker", { x: turn(answer.reply.input), degreesY: true, series: [{ values: turn(output), colour: "ink" }] }));
  const ends = x ? `x from ${text(x[0])} to ${text(x.at(-1))} over this interval. ` : "";
  $("error-note").textContent = ends + answer.reply.report.notes.join(". ");
}

function select(k) {
  shown = answer.reply.solutions[k];
  [...$("solutions").children].forEach((item, n) => item.firstChild.setAttribute("aria-pressed", String(n === k)));
  showLinkage();
  showNumbers();
}

function card(solution, k) {
  const button = Object.assign(document.createElement("button"), { type: "button" });
  button.append(thumbnail(new Linkage({ ...solution, mount: null }), [0, answer.request.crank_span * RAD], []));
  button.append(Object.assign(document.createElement("span"), { className: "name", textContent: `${solution.rank}. ${text(solution.errors.max, 3)}°` }));
  const verdict = mark(solution.verdict);
  button.append(Object.assign(document.createElement("span"), { className: `verdict ${verdict.kind}`, textContent: `${verdict.sign} ${verdict.text}` }));
  button.addEventListener("click", () => select(k));
  const item = document.createElement("li");
  item.append(button);
  return item;
}

function show(request, reply) {
  answer = { request, reply };
  shown = null;
  const found = reply.solutions.length > 0;
  for (const id of ["picture-card", "error-card", "results", "numbers-card"]) $(id).hidden = !found;
  say(STATUS[reply.status], !found);
  $("solutions").replaceChildren(...reply.solutions.map(card));
  $("slider").value = "0";
  if (found) select(0);
}

async function solve(event) {
  event.preventDefault();
  running?.abort();
  running = new AbortController();
  try {
    const request = toRequest();
    say("Searching…");
    show(request, await (await ask("/v1/function", request, running.signal)).json());
  } catch (error) {
    if (error.name !== "AbortError") say(error.message, true);
  }
}

async function save(format) {
  $("export-note").textContent = `Making ${format.toUpperCase()}…`;
  try {
    const reply = await ask("/v1/function/export", { request: answer.request, solution: shown, format });
    const name = `function-${shown.rank}.${format === "mjcf" ? "xml" : format}`;
    download(await reply.blob(), name);
    $("export-note").textContent = `Saved ${name}.`;
  } catch (error) { $("export-note").textContent = error.message; }
}

startTheme();
startScenes();
startPad();
document.body.dataset.ready = "true";
showFields();
$("name").addEventListener("change", showFields);
$("form").addEventListener("input", showRequest);
$("request").addEventListener("toggle", showRequest);
$("form").addEventListener("submit", solve);
for (const button of $("exports").children) button.addEventListener("click", () => save(button.dataset.format));
redrawOn($("curves"), () => answer && showCurves());
