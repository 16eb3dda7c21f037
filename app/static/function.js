// The page of function generation: a function chosen, drawn or typed; the linkages whose rocker, crank or slider moves so; their error.

import { redrawOn, titledChart } from "./charts.js";
import { numberIn as number, startNumbers } from "./decimal.js";
import { Draft } from "./draft.js";
import { LinkageShape, View, button, element, make, namedRows, put, text, thumbnail } from "./drawing.js";
import { Linkage } from "./kinematics.js";
import { fromFragment, toFragment } from "./link.js";
import { Pairs } from "./pairs.js";
import { RAD } from "./plane.js";
import { ask, download } from "./service.js";
import { $, capital, copy, markEarlier, say, startScenes, startTheme } from "./shell.js";
import { DRIVES, SIZES, SPECIAL, checkDrive, sign, travelRows } from "./travel.js";
import { mark, plainNote, reasons } from "./verdict.js";
import { Visits, readdress } from "./visits.js";

const DRAWN = 41; // samples of a drawn curve
const PAD = { width: 320, height: 200, border: 8 };
const STATUS = {
  reached: "Solved: the best linkage makes the function to within rounding.",
  infeasible: "No linkage was found within these limits. Loosen one of them.",
  unknown: "No linkage was found before the search was cut short, which proves nothing.",
};
/** Ends of x that a function begins with; others with 1 and 2. */
const ENDS = { sin: ["0", "90"], cos: ["0", "90"], tan: ["0", "45"] };
const endsOf = (name) => ENDS[name] ?? ["1", "2"];
const LINKS = ["crank", "coupler", "rocker", "ground"];

let drawn = []; // points [px, py] of the pad, from left to right
let answer = null; // {request, reply, signs, from}: the units behind input and output, the crank angle given first
let shown = null; // the selected solution
let charts = []; // of its error
let running = null; // AbortController of the search that runs
let linked = null; // the question of a link as it came
let named = "log10"; // the function that was chosen before

const untouched = JSON.stringify(asIs());
const rowsTyped = new Pairs(showFields);
const FEW_ROWS = 5; // as many as a four-bar has free numbers: it can meet them exactly
const draft = new Draft("linkage-atlas-function", (content) => fill(content), clear);
const visits = new Visits(showAgain, (question) => {
  fill(question);
  solve();
});

// -- the question

/** The drawn curve at even x, smoothed over its neighbours: [[x, y], ...] with both in 0 .. 1. */
function drawnTable() {
  if (drawn.length < 3) throw new Error("Draw the function from left to right first.");
  const first = drawn[0][0],
    last = drawn.at(-1)[0];
  let k = 1;
  const heights = Array.from({ length: DRAWN }, (_, n) => {
    const x = first + ((last - first) * n) / (DRAWN - 1);
    while (k < drawn.length - 1 && drawn[k][0] < x) k++;
    const [x0, y0] = drawn[k - 1],
      [x1, y1] = drawn[k];
    return 1 - (y0 + ((y1 - y0) * (x - x0)) / (x1 - x0)) / PAD.height;
  });
  const smooth = (values) =>
    values.map((value, n) => (n && n < values.length - 1 ? (values[n - 1] + 2 * value + values[n + 1]) / 4 : value));
  return smooth(smooth(smooth(heights))).map((y, n) => [n / (DRAWN - 1), Number(y.toFixed(6))]);
}

const typed = () => rowsTyped.of($("table").value, $("name").value === "table");

/** Has the service read the table, if it is asked for. */
const readTyped = () => (["table", "pairs"].includes($("name").value) ? rowsTyped.read($("table").value) : null);

/** What of a request says which function is wanted; given angles are asked for as they are, in their unit. */
function wantedOf(name) {
  if (name === "quick")
    return {
      quick_return: { [SIZES[$("drive").value]?.field ?? "swing"]: number("stroke"), time_ratio: number("time-ratio") },
    };
  if (name === "steering")
    return { steering: { track: number("track"), wheelbase: number("wheelbase"), angle: number("inner") } };
  const dials = { output_span: number("output-span") },
    crank_span = number("crank-span");
  if (name === "drawn") return { function: { ...dials, table: drawnTable() }, crank_span };
  if (name === "table" || name === "pairs") {
    const { x, y, input, output } = typed();
    if (x) return { function: { ...dials, table: x.map((value, k) => [value, y[k]]) }, crank_span };
    return { output, ...(input ? { input } : { crank_span }) };
  }
  return {
    function: {
      ...dials,
      name,
      x: [number("x0"), number("x1")],
      ...(name === "power" ? { exponent: number("exponent") } : {}),
    },
    crank_span,
  };
}

function toRequest() {
  const drive = $("drive").value,
    { asks } = DRIVES[drive],
    travels = drive !== "four_bar";
  const name = $("name").value,
    special = SPECIAL.includes(name) && checkDrive(name, drive);
  const { crank_span, ...others } = wantedOf(name);
  if (others.output) rowsTyped.check(asks);
  const span = crank_span === undefined ? {} : { [asks.input_unit ? "travel_span" : "crank_span"]: crank_span };
  const wanted = { ...others, ...span, ...(special ? {} : asks) },
    limits = travels ? {} : { family: $("family").value };
  if ($("practical").checked) limits.preset = "practical";
  if (number("transmission") !== null) limits.transmission_angle_min = number("transmission");
  if (number("ratio") !== null) limits.link_ratio_max = number("ratio");
  if (
    number("ground") !== null &&
    name !== "steering" &&
    ["four_bar", "crank_cylinder", "cylinder_crank"].includes(drive)
  )
    limits.links = { ground: number("ground") };
  if (number("offset") !== null && asks.mechanisms?.[0] === "slider_crank") limits.offset = number("offset");
  const request = {
    ...wanted,
    ...(name === "quick" ? {} : { objective: $("objective").value }),
    limits,
    top: number("top"),
    curves: true,
  };
  if ($("one-way").checked && !special) request.one_way = true;
  if (number("round") !== null && !travels) {
    if (number("ground") === null && name !== "steering")
      throw new Error("To round links, give the distance of the pivots: it says how long they are.");
    request.round_to = number("round");
  }
  return request;
}

/** The fields that the function needs; columns that are named say what a table holds. */
function showFields() {
  readTyped();
  if (named !== $("name").value && ["x0", "x1"].every((id, k) => $(id).value === endsOf(named)[k]))
    endsOf($("name").value).forEach((end, k) => {
      $(`x${k}`).value = end;
    });
  named = $("name").value;
  let columns = {};
  try {
    columns = typed();
  } catch {
    /* it is said when it is asked for */
  }
  if (columns.x && $("name").value === "pairs") $("name").value = "table";
  if (columns.output && $("name").value === "table") $("name").value = "pairs";
  const name = $("name").value,
    pairs = name === "pairs";
  const assumed = pairs && columns.output?.length <= FEW_ROWS && $("objective").value === "max";
  $("table-note").textContent = assumed
    ? `${rowsTyped.notes} The largest error anywhere counts the curve between the rows too, which is assumed to be smooth. To meet these rows only, choose root mean square error.`.trim()
    : rowsTyped.notes;
  const special = SPECIAL.includes(name),
    curve = name !== "quick";
  const kinds = {
    name: !["drawn", "table", "pairs", ...SPECIAL].includes(name),
    crank: !special && (!pairs || !columns.input),
    rocker: !special && !pairs,
    curve,
    [name]: true,
  };
  for (const block of document.querySelectorAll("[data-for]"))
    block.hidden = !block.dataset.for.split(" ").some((kind) => kinds[kind]);
  const { asks, says } = DRIVES[$("drive").value];
  for (const [k, end] of ["input", "output"].entries()) {
    $(`${end}-label`).textContent = says[k];
    $(`${end}-unit`).textContent = asks[`${end}_unit`] ? "length" : "°";
  }
  for (const field of document.querySelectorAll("[data-drive]"))
    field.hidden = !field.dataset.drive.split(" ").includes($("drive").value);
  [$("stroke-label").textContent, $("stroke-unit").textContent] = (SIZES[$("drive").value] ?? SIZES.four_bar).says;
  for (const [id, kind] of [
    ["stroke", "quick"],
    ["time-ratio", "quick"],
    ["track", "steering"],
    ["wheelbase", "steering"],
    ["inner", "steering"],
  ])
    $(id).disabled = !kinds[kind];
  for (const [id, kind] of [
    ["x0", "name"],
    ["x1", "name"],
    ["crank-span", "crank"],
    ["output-span", "rocker"],
  ])
    $(id).disabled = !kinds[kind];
  changed();
}

/** After every change of the question: it is kept as a draft, and the answer that is shown may be that of another one. */
function changed() {
  showRequest();
  const content = asIs(),
    own = ![untouched, linked].includes(JSON.stringify(content));
  draft.see(content, own);
  visits.leave(content);
  if (own && /^#[zj]=/.test(location.hash)) readdress("");
  if (!answer || running) return;
  let request = null;
  try {
    request = toRequest();
  } catch {
    /* it cannot be asked as it is */
  }
  const earlier = JSON.stringify(request) !== JSON.stringify(answer.request);
  markEarlier(earlier);
  if (earlier) say("Inputs changed. Solve again.");
  else sayStatus();
}

// -- the question as a link and as a draft

function fields() {
  return [...$("form").elements].filter((one) => one.id && one.matches("input, select, textarea"));
}

/** The form as it is: the values of its fields by their ids, and the drawn curve. */
function asIs() {
  return {
    fields: Object.fromEntries(fields().map((one) => [one.id, one.type === "checkbox" ? one.checked : one.value])),
    drawn,
  };
}

/** Fills the form as `asIs` has told it, perhaps from a link. Throws for what it has not. */
function fill(content, ofLink = false) {
  if (typeof content?.fields !== "object" || !content.fields || !Array.isArray(content.drawn))
    throw new Error("The link is of another page or version.");
  for (const one of fields()) {
    const value = content.fields[one.id];
    if (one.type === "checkbox") one.checked = value === true;
    else if (typeof value === "string") one.value = value;
    if (one.selectedIndex < 0) one.selectedIndex = 0;
  }
  named = $("name").value;
  drawn = content.drawn.filter((point) => Array.isArray(point) && point.length === 2 && point.every(Number.isFinite));
  tracePad();
  if (ofLink) linked = JSON.stringify(asIs());
  showFields();
}

function clear() {
  $("form").reset();
  drawn = [];
  tracePad();
  showFields();
}

/** Asks the question in the page's address; false if there is none. */
async function openLink() {
  const { hash } = location,
    content = await fromFragment(hash);
  if (!content || location.hash !== hash) return false;
  fill(content, true);
  solve();
  return true;
}

/** After another address: the question in it; after a link that is as it came, what was there before. */
async function addressChanged() {
  const opened = await openLink().catch((error) => {
    say(error.message, true);
    return true;
  });
  if (!opened && !location.hash && linked === JSON.stringify(asIs()) && !draft.restore()) clear();
}

async function copyLink() {
  const link = new URL(location.href),
    content = asIs();
  linked = JSON.stringify(content);
  link.hash = await toFragment(content);
  readdress(link.hash);
  await copy(link.href, "The link is copied; it holds the question.", (words) => {
    $("export-note").textContent = words;
  });
}

function showRequest() {
  if (!$("request").open) return;
  try {
    $("request-text").textContent = JSON.stringify(toRequest(), null, 1);
  } catch (error) {
    $("request-text").textContent = error.message;
  }
}

// -- the pad

function tracePad() {
  put($("pad").querySelector(".pen"), {
    d: drawn.length > 1 ? `M${drawn.map((point) => point.map((v) => v.toFixed(1)).join(" ")).join("L")}` : "",
  });
}

function startPad() {
  const pad = $("pad"),
    { width, height, border } = PAD;
  make("rect", { class: "frame", x: 0.5, y: 0.5, width: width - 1, height: height - 1 }, pad);
  make("path", { class: "pen" }, pad);
  const place = (event) => {
    const box = pad.getBoundingClientRect();
    const clip = (value, most) => Math.min(Math.max(value, border), most - border);
    return [
      clip(((event.clientX - box.left) / box.width) * width, width),
      clip(((event.clientY - box.top) / box.height) * height, height),
    ];
  };
  pad.addEventListener("pointerdown", (event) => {
    pad.setPointerCapture(event.pointerId);
    drawn = [place(event)];
    tracePad();
  });
  pad.addEventListener("pointermove", (event) => {
    if (!pad.hasPointerCapture(event.pointerId)) return;
    const point = place(event);
    if (point[0] > drawn.at(-1)[0] + 0.5) drawn.push(point); // a function has one y for each x
    tracePad();
  });
  pad.addEventListener("pointerup", changed);
  $("pad-clear").addEventListener("click", () => {
    drawn = [];
    tracePad();
    changed();
  });
}

// -- the answer

function rows(solution) {
  if (solution.guides && solution.lengths) return travelRows(solution, answer.signs);
  const { errors, rounded } = solution;
  const list = LINKS.map((name) => [capital(name), text(solution.links[name], 8)]);
  list.push(
    ["Branch", solution.branch > 0 ? "+1" : "−1"],
    ["Crank at the first x", `${text(solution.start_angle, 8)}°`],
    ["Output less rocker angle", `${text(solution.output_offset, 8)}°`],
  );
  list.push(["Largest error", `${text(errors.max, 4)}°`], ["Root mean square error", `${text(errors.rms, 4)}°`]);
  if (errors.max_y !== null) list.push(["Largest error in y", text(errors.max_y, 4)]);
  if (errors.alternations !== null) list.push(["Extremes as large, alternating", String(errors.alternations)]);
  list.push(
    ["Family", solution.family.replaceAll("_", "-")],
    ["Transmission", `${text(solution.transmission_angle_min, 5)}°`],
  );
  if (solution.transmission_angle_min_turn !== null)
    list.push(["Transmission, whole turn", `${text(solution.transmission_angle_min_turn, 5)}°`]);
  if (rounded?.closes)
    list.push(
      ["Rounded links", LINKS.map((name) => text(rounded.links[name], 8)).join(", ")],
      ["Largest error when rounded", `${text(rounded.errors.max, 4)}°`],
    );
  else if (rounded) list.push(["Rounded links", "do not close"]);
  return list;
}

function showNumbers() {
  $("numbers").replaceChildren(
    namedRows(rows(shown)),
    ...reasons(shown.verdict).map((sentence) => element("p", "note", sentence)),
  );
}

function showLinkage() {
  const span = answer.reply.input.at(-1) * RAD,
    linkage = new Linkage(shown),
    [into, out] = answer.signs;
  const { clientWidth: width, clientHeight: height } = $("canvas"),
    view = new View(width, height),
    used = linkage.over(0, span, 120).filter(Boolean);
  $("canvas").replaceChildren();
  put($("canvas"), { viewBox: `0 0 ${width} ${height}` });
  if (!used.length) return;
  view.fit([used[0].a, used[0].b, ...used.flatMap(({ c, d }) => [c, d])], 28);
  const arc = (key) =>
    make(
      "path",
      {
        class: "curve",
        d: used
          .map(
            (joints, k) =>
              `${k ? "L" : "M"}${view
                .at(joints[key])
                .map((v) => v.toFixed(2))
                .join(" ")}`,
          )
          .join(""),
      },
      $("canvas"),
    );
  arc("d");
  arc("c");
  const shape = new LinkageShape($("canvas"));
  const move = () => {
    const share = Number($("slider").value),
      joints = linkage.at(share * span);
    shape.show(joints, view);
    const made =
      joints &&
      (shown.links ? joints.frames.rocker.angle / RAD + shown.output_offset : wantedAt(share) + errorAt(share));
    const wrapped = made === null || !out ? made : made - 360 * Math.round((made - wantedAt(share)) / 360);
    const crank = answer.from + (share * span) / RAD;
    $("where").textContent = joints
      ? `${text(crank, 4)}${into}, ${shown.links ? "rocker" : "output"} ${text(wrapped, 5)}${out}`
      : "does not close here";
    for (const plot of charts) plot.mark(crank);
  };
  $("slider").oninput = move;
  showCurves();
  move();
}

/** The wanted output at a share of the interval, between the samples in a straight line. */
function wantedAt(share) {
  const { input, output } = answer.reply,
    x = share * input.at(-1);
  const side = Math.sign(input.at(-1)),
    after = input.findIndex((value) => side * value >= side * x);
  const k = after < 0 ? input.length - 1 : Math.max(1, after);
  return output[k - 1] + ((output[k] - output[k - 1]) * (x - input[k - 1])) / (input[k] - input[k - 1]);
}

/** The error of the solution on show, got minus wanted, at a fraction of the interval. */
function errorAt(share) {
  const { error } = shown.error_curve,
    place = share * (error.length - 1),
    k = Math.min(Math.floor(place), error.length - 2);
  return error[k] + (error[k + 1] - error[k]) * (place - k);
}

function showCurves() {
  const { error } = shown.error_curve,
    { x, y, output } = answer.reply,
    [into, out] = answer.signs,
    degreesX = Boolean(into);
  const [input, samples] = [shown.error_curve.input, answer.reply.input].map((angles) =>
    angles.map((angle) => angle + answer.from),
  );
  const turn = answer.reply.input.at(-1) < 0 ? (values) => values.slice().reverse() : (values) => values;
  $("curves").replaceChildren();
  charts = [
    titledChart(
      $("curves"),
      `${answer.request.quick_return ? "Deviation from an even motion," : "Error (got minus wanted)"} ${shown.links ? "in degrees of the rocker" : out ? "in degrees" : "of the travel"}`,
      { x: turn(input), degreesX, degreesY: Boolean(out), series: [{ values: turn(error), colour: "accent" }] },
    ),
  ];
  const range = (values) => Math.max(...values) - Math.min(...values);
  if (y && range(output)) {
    const unit = range(y) / range(output);
    charts.push(
      titledChart($("curves"), "Error (got minus wanted) in units of y", {
        x: turn(input),
        degreesX,
        series: [{ values: turn(error.map((value) => value * unit)), colour: "path" }],
      }),
    );
  }
  charts.push(
    titledChart($("curves"), shown.links ? "Wanted angle of the rocker" : "Wanted output", {
      x: turn(samples),
      degreesX,
      degreesY: Boolean(out),
      series: [{ values: turn(output), colour: "ink" }],
    }),
  );
  const ends = x ? `x from ${text(x[0])} to ${text(x.at(-1))} over this interval. ` : "";
  $("error-note").textContent = ends + answer.reply.report.notes.map((one) => plainNote(one)).join(" ");
}

function select(k) {
  shown = answer.reply.solutions[k];
  [...$("solutions").children].forEach((item, n) => item.firstChild.setAttribute("aria-pressed", String(n === k)));
  showLinkage();
  showNumbers();
}

function card(solution, k) {
  const one = button("", () => select(k)),
    verdict = mark(solution.verdict),
    item = element("li", "");
  one.append(
    thumbnail(new Linkage(solution), [0, answer.reply.input.at(-1) * RAD], []),
    element("span", "name", `${solution.rank}. ${text(solution.errors.max, 3)}${answer.signs[1]}`),
    element("span", `verdict ${verdict.kind}`, `${verdict.sign} ${verdict.text}`),
  );
  item.append(one);
  return item;
}

function sayStatus() {
  const {
    status,
    solutions: [best],
    report,
  } = answer.reply;
  if (!best && report.notes.length)
    return say(`${STATUS[status]} ${report.notes.map((note) => plainNote(note)).join(" ")}`, true);
  const rounded = best?.rounded?.closes ? ` With rounded links: ${text(best.rounded.errors.max, 3)}°.` : "";
  say((STATUS[status] ?? `Best found: off by at most ${text(best.errors.max, 3)}${answer.signs[1]}.`) + rounded, !best);
}

function show(request, reply) {
  const signs = [sign(request.input_unit), request.quick_return?.stroke ? "" : sign(request.output_unit)];
  answer = { request, reply, signs, from: request.input?.[0] ?? 0 };
  shown = null;
  const found = reply.solutions.length > 0;
  for (const id of ["picture-card", "error-card", "results", "numbers-card"]) $(id).hidden = !found;
  $("export-note").textContent = "";
  $("solutions").replaceChildren(...answer.reply.solutions.map(card));
  $("slider").value = "0";
  if (found) select(0);
  changed();
}

/** Shows an answer of this page again, with its question in the form. */
function showAgain({ content, request, reply }, left) {
  running = running?.abort();
  fill(content);
  show(request, reply);
  if (left) fill(left);
}

async function solve() {
  running?.abort();
  const control = new AbortController(),
    content = asIs();
  running = control;
  markEarlier(Boolean(answer));
  try {
    await readTyped();
    const request = toRequest();
    say("Searching…");
    const reply = await (await ask("/v2/function", request, control.signal)).json();
    running = null;
    visits.add(content, { content, request, reply });
    show(request, reply);
  } catch (error) {
    if (error.name !== "AbortError") say(error.message, true);
  } finally {
    if (running === control) running = null;
  }
}

async function save(format) {
  const { request } = answer,
    solution = shown;
  $("export-note").textContent = `Making ${format.toUpperCase()}…`;
  try {
    const reply = await ask("/v2/function/export", { request, linkage: solution, format });
    const name = `function-${solution.rank}.${format === "mjcf" ? "xml" : format}`;
    download(await reply.blob(), name);
    $("export-note").textContent = `Saved ${name}.`;
  } catch (error) {
    $("export-note").textContent = error.message;
  }
}

for (const begin of [startTheme, startNumbers, startScenes, startPad, showFields]) begin();
for (const kind of ["input", "change"]) $("form").addEventListener(kind, showFields);
$("request").addEventListener("toggle", showRequest);
$("form").addEventListener("submit", (event) => {
  event.preventDefault();
  solve();
});
$("link").addEventListener("click", copyLink);
addEventListener("hashchange", addressChanged);
// a page that opens without a question of one's own shows the answer to its first one
openLink()
  .then(
    (found) => {
      if (!found && !draft.restore()) solve();
    },
    (error) => {
      say(error.message, true);
      draft.restore();
    },
  )
  .then(() => {
    document.body.dataset.ready = "true";
  });
for (const one of $("exports").children) one.addEventListener("click", () => save(one.dataset.format));
redrawOn($("canvas"), () => shown && showLinkage());
