// The page: puts motion, canvas, table, solutions and watch together.

import { Board } from "./board.js";
import { chart, redrawOn } from "./charts.js";
import { text, thumbnail } from "./drawing.js";
import { Linkage } from "./kinematics.js";
import { History, emptyMotion, fault, fixTravels, fromCsv, fromFragment, fromRequest, nextPose, scaleTravels, toFragment, toRequest, travels } from "./motion.js";
import { STAGES, ask, download, solve } from "./service.js";
import { startScenes, startTheme } from "./theme.js";

const $ = (id) => document.getElementById(id);
const RAD = Math.PI / 180;
const FAMILIES = {
  crank_rocker: "crank-rocker", double_crank: "double-crank", rocker_crank: "rocker-crank",
  double_rocker: "double-rocker", triple_rocker: "triple-rocker", change_point: "change point",
};

let chosenPose = 0;
let found = null; // {request, reply, motion}: the last answer
let rank = 0; // index of the chosen solution
let watched = null; // {linkage, used, turn, ...} of the chosen solution
let running = null; // AbortController of the search that runs
let examples = [];

const history = new History(emptyMotion(), () => motionChanged());
const board = new Board($("canvas"), $("canvas-help"), {
  edit: (change, kind) => history.change((motion) => { change(motion); }, kind),
  settle: () => history.settle(),
  choose: (k) => choosePose(k),
  add: (at) => addPose(at),
  remove: (k) => removePose(k),
});

// -- the motion --------------------------------------------------------------------------------------------------------

function motionChanged() {
  const motion = history.value;
  $("undo").disabled = !history.past.length;
  $("redo").disabled = !history.future.length;
  chosenPose = Math.max(0, Math.min(chosenPose, motion.poses.length - 1));
  board.stale = Boolean(found) && JSON.stringify(toRequest(motion)) !== JSON.stringify(found.request);
  $("results").classList.toggle("stale", board.stale);
  if (board.stale && !running) say("The motion has changed since it was solved.");
  else if (found && !running) sayStatus(found.reply);
  board.show(motion, chosenPose);
  showTable();
  showFields();
}

function set(element, value) {
  if (element !== document.activeElement) element.value = value ?? "";
}

function showFields() {
  const motion = history.value, { limits } = motion;
  set($("span"), Number(motion.span.toPrecision(12)));
  set($("direction"), String(motion.direction));
  set($("even"), motion.even ? "1" : "0");
  set($("wanted"), motion.wanted);
  set($("family"), limits.family);
  set($("transmission"), limits.transmission || "");
  set($("link-min"), limits.min);
  set($("link-max"), limits.max);
  set($("round"), motion.round);
  set($("top"), motion.top);
  for (let k = 0; k < 4; k++) set($(`box-${k}`), limits.box?.[k]);
  const active = [];
  if (limits.family !== "full_crank") active.push($("family").selectedOptions[0]?.textContent);
  if (limits.transmission) active.push(`transmission ≥ ${text(limits.transmission, 3)}°`);
  if (limits.min || limits.max) active.push("link lengths");
  if (limits.box) active.push("pivot box");
  if (motion.round) active.push(`rounded to ${text(motion.round)}`);
  $("limits-summary").textContent = active.join(", ") || "crank turns fully";
  $("box-clear").hidden = !limits.box;
}

const CELLS = [["t", "crank angle"], ["x", "x"], ["y", "y"], ["angle", "angle"]];

function showTable() {
  const motion = history.value, body = $("poses").tBodies[0], angles = travels(motion);
  while (body.rows.length > motion.poses.length) body.deleteRow(-1);
  while (body.rows.length < motion.poses.length) body.append(makeRow(body.rows.length));
  motion.poses.forEach((pose, k) => {
    const row = body.rows[k];
    row.className = k === chosenPose ? "chosen" : "";
    CELLS.forEach(([name], column) => {
      const input = row.cells[column + 1].firstChild;
      const value = name === "t" ? angles[k] : pose[name];
      if (input !== document.activeElement) input.value = Number(value.toPrecision(6));
      if (name === "t") input.readOnly = motion.even || k === 0;
      else input.disabled = (motion.wanted === "rotation" && name !== "angle") || (motion.wanted === "position" && name === "angle");
    });
  });
}

function makeRow(k) {
  const row = document.createElement("tr");
  row.insertCell().textContent = String(k + 1);
  for (const [name, label] of CELLS) {
    const input = document.createElement("input");
    input.type = "text";
    input.inputMode = "decimal";
    input.setAttribute("aria-label", `Pose ${k + 1}, ${label}`);
    input.addEventListener("focus", () => {
      choosePose(k);
      // all digits while the number is being edited
      const motion = history.value;
      input.value = name === "t" ? Number(travels(motion)[k].toPrecision(14)) : motion.poses[k][name];
    });
    input.addEventListener("input", () => {
      const value = Number(input.value.replace(",", "."));
      const good = input.value.trim() !== "" && Number.isFinite(value);
      input.classList.toggle("invalid", !good);
      if (good && !input.readOnly) history.change((motion) => {
        motion.poses[k][name] = value;
        if (name === "t" && k === motion.poses.length - 1) motion.span = value;
      }, `cell ${k} ${name}`);
    });
    input.addEventListener("change", () => { history.settle(); input.classList.remove("invalid"); });
    input.addEventListener("blur", () => showTable());
    row.insertCell().append(input);
  }
  const remove = document.createElement("button");
  remove.type = "button";
  remove.className = "quiet";
  remove.textContent = "×";
  remove.setAttribute("aria-label", `Remove pose ${k + 1}`);
  remove.addEventListener("click", () => removePose(k));
  row.insertCell().append(remove);
  return row;
}

function choosePose(k) {
  if (k === chosenPose) return;
  chosenPose = k;
  board.show(history.value, k);
  const rows = $("poses").tBodies[0].rows;
  for (const [j, row] of [...rows].entries()) row.className = j === k ? "chosen" : "";
  const box = document.querySelector(".table"), row = rows[k];
  if (row && (row.offsetTop < box.scrollTop + 30 || row.offsetTop + row.offsetHeight > box.scrollTop + box.clientHeight)) box.scrollTop = row.offsetTop - 60;
}

function addPose(at = null) {
  chosenPose = history.value.poses.length;
  history.change((motion) => {
    motion.poses.push(nextPose(motion, at));
    if (!motion.even) motion.span = motion.poses.at(-1).t - motion.poses[0].t || motion.span;
  });
}

function removePose(k) {
  history.change((motion) => {
    motion.poses.splice(k, 1);
    if (!motion.even && motion.poses.length > 1) {
      const first = motion.poses[0].t;
      motion.poses.forEach((pose) => { pose.t -= first; });
      motion.span = motion.poses.at(-1).t;
    }
  });
}

function useMotion(motion) {
  found = null;
  watched = null;
  stopSearch();
  showResults();
  chosenPose = 0;
  history.change(() => motion);
  say("");
  board.fit();
}

/** A field of the form that changes the motion. */
function bind(id, change) {
  const element = $(id);
  const event = element.tagName === "SELECT" ? "change" : "input";
  element.addEventListener(event, () => {
    const value = element.value.trim();
    if (element.type === "number" && value !== "" && !element.checkValidity()) return;
    history.change((motion) => { change(motion, element.type === "number" ? (value === "" ? null : Number(value)) : value); }, id);
  });
  element.addEventListener("blur", () => { history.settle(); showFields(); });
}

function bindForm() {
  bind("span", (motion, value) => {
    if (!value) return;
    if (motion.even) motion.span = value;
    else scaleTravels(motion, value);
  });
  bind("direction", (motion, value) => { motion.direction = Number(value); });
  bind("even", (motion, value) => {
    if (motion.even) fixTravels(motion);
    motion.even = value === "1";
  });
  bind("wanted", (motion, value) => { motion.wanted = value; });
  bind("family", (motion, value) => { motion.limits.family = value; });
  bind("transmission", (motion, value) => { motion.limits.transmission = value ?? 0; });
  bind("link-min", (motion, value) => { motion.limits.min = value; });
  bind("link-max", (motion, value) => { motion.limits.max = value; });
  bind("round", (motion, value) => { motion.round = value; });
  bind("top", (motion, value) => { if (value) motion.top = value; });
  for (let k = 0; k < 4; k++) {
    bind(`box-${k}`, (motion) => {
      const box = [0, 1, 2, 3].map((j) => ($(`box-${j}`).value === "" ? NaN : Number($(`box-${j}`).value)));
      if (box.every(Number.isFinite)) motion.limits.box = box;
      else if (box.every(Number.isNaN)) motion.limits.box = null;
    });
  }
  $("box-clear").addEventListener("click", () => history.change((motion) => { motion.limits.box = null; }));
  $("add-row").addEventListener("click", () => addPose());
  $("clear").addEventListener("click", () => { $("example").value = ""; $("example-note").textContent = ""; useMotion(emptyMotion()); setMode("add"); });
  $("undo").addEventListener("click", () => history.undo());
  $("redo").addEventListener("click", () => history.redo());
  document.addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.altKey || event.target.matches?.("textarea")) return;
    const key = event.key.toLowerCase();
    if (key !== "z" && key !== "y") return;
    event.preventDefault();
    document.activeElement?.matches?.("input") && document.activeElement.blur();
    if (key === "y" || event.shiftKey) history.redo();
    else history.undo();
  });
  for (const button of document.querySelectorAll("[data-mode]:not(svg)")) button.addEventListener("click", () => setMode(button.dataset.mode));
  $("fit").addEventListener("click", () => board.fit());
  $("zoom-in").addEventListener("click", () => board.zoom(1.3));
  $("zoom-out").addEventListener("click", () => board.zoom(1 / 1.3));
}

function setMode(mode) {
  board.setMode(mode);
  for (const button of document.querySelectorAll("[data-mode]:not(svg)")) button.setAttribute("aria-pressed", String(button.dataset.mode === mode));
}

// -- files, examples, links --------------------------------------------------------------------------------------------

function readText(content) {
  const start = content.trimStart();
  if (!start.startsWith("{")) return fromCsv(content, history.value);
  let body;
  try { body = JSON.parse(start); } catch { throw new Error("The file is not valid JSON."); }
  return fromRequest(body.request ?? body);
}

function bindFiles() {
  $("paste").addEventListener("click", () => { $("paste-box").hidden = !$("paste-box").hidden; if (!$("paste-box").hidden) $("paste-text").focus(); });
  $("paste-cancel").addEventListener("click", () => { $("paste-box").hidden = true; });
  $("paste-use").addEventListener("click", () => {
    try {
      useMotion(readText($("paste-text").value));
      $("paste-box").hidden = true;
      $("paste-error").textContent = "";
      $("example").value = "";
      $("example-note").textContent = "";
    } catch (error) { $("paste-error").textContent = error.message; }
  });
  $("open").addEventListener("click", () => $("file").click());
  const take = async (file) => {
    try {
      if (file.size > 2e6) throw new Error("The file is larger than 2 MB: that is no motion.");
      useMotion(readText(await file.text()));
      $("example-note").textContent = `From ${file.name}`;
      $("example").value = "";
    } catch (error) { say(error.message, true); }
  };
  $("file").addEventListener("change", () => { if ($("file").files[0]) take($("file").files[0]); $("file").value = ""; });
  document.addEventListener("dragover", (event) => event.preventDefault());
  document.addEventListener("drop", (event) => { event.preventDefault(); if (event.dataTransfer.files[0]) take(event.dataTransfer.files[0]); });
  $("example").addEventListener("change", () => loadExample($("example").value));
  addEventListener("hashchange", () => { openLink().catch((error) => say(error.message, true)); });
}

function loadExample(name) {
  const example = examples.find((one) => one.name === name);
  if (!example) return;
  $("example").value = name;
  $("example-note").textContent = example.word;
  setMode("move");
  useMotion(fromRequest(example.request));
}

let ownFragment = null;

async function openLink() {
  if (location.hash === ownFragment) return false;
  const request = await fromFragment(location.hash);
  if (!request) return false;
  useMotion(fromRequest(request));
  $("example").value = "";
  $("example-note").textContent = "From a link";
  return true;
}

// -- solve -------------------------------------------------------------------------------------------------------------

function say(sentence, bad = false) {
  $("status").textContent = sentence;
  $("status").classList.toggle("bad", bad);
}

const STATUS = {
  reached: "Solved: the best linkage makes the motion to within rounding.",
  closest: "No linkage makes exactly this motion; these come closest.",
  infeasible: "No linkage keeps to these limits. Loosen one of them.",
};

function sayStatus(reply) {
  say(STATUS[reply.status], reply.status === "infeasible");
}

function stopSearch() {
  running?.abort();
  running = null;
  $("stop").hidden = true;
  $("progress").hidden = true;
  $("solve").disabled = false;
}

async function solveNow() {
  const motion = JSON.parse(JSON.stringify(history.value));
  const wrong = fault(motion);
  if (wrong) {
    say(wrong[0], true);
    $(wrong[1])?.focus?.();
    return;
  }
  stopSearch();
  const request = toRequest(motion);
  const control = new AbortController();
  running = control;
  const begin = performance.now();
  $("solve").disabled = true;
  $("stop").hidden = false;
  const progress = $("progress");
  progress.hidden = false;
  progress.value = 0;
  say("Searching…");
  const whole = STAGES.reduce((sum, budget) => sum + budget);
  const ticking = setInterval(() => { progress.value = Math.min(1, Math.sqrt((performance.now() - begin) / whole)); }, 100);
  let first = true;
  try {
    await solve(request, (reply, last) => {
      if (running !== control) return;
      found = { request, reply, motion };
      board.stale = false;
      rank = first ? 0 : Math.min(rank, Math.max(0, reply.solutions.length - 1));
      showResults();
      if (first) performance.measure("first result", { start: begin, end: performance.now() });
      first = false;
      if (!last) say(`Best so far after ${Math.round(performance.now() - begin)} ms; still searching…`);
    }, control.signal);
    if (running === control && found) sayStatus(found.reply);
  } catch (error) {
    if (error.name !== "AbortError") say(error.message, true);
  } finally {
    clearInterval(ticking);
    if (running === control) {
      running = null; // it has ended: nothing to abort
      stopSearch();
    }
    motionChangedQuietly();
  }
}

function motionChangedQuietly() {
  board.stale = Boolean(found) && JSON.stringify(toRequest(history.value)) !== JSON.stringify(found.request);
  board.draw();
}

// -- results -----------------------------------------------------------------------------------------------------------

/** An error; what is only rounding, against the motion's size, is said to be. */
function small(value, size, unit = "") {
  if (value === null) return null;
  return value < 1e-12 * size ? "rounding" : `${text(value, 3)}${unit}`;
}

function showResults() {
  const solutions = found?.reply.solutions ?? [];
  for (const id of ["results", "trace-card", "curves-card", "numbers-card", "player"]) $(id).hidden = !solutions.length;
  const list = $("solutions");
  list.replaceChildren();
  if (!solutions.length) {
    watched = null;
    pause();
    board.showLinkage(null);
    return;
  }
  const { motion, reply } = found;
  const span = motion.direction * motion.span * RAD;
  const targets = motion.wanted === "rotation" ? [] : motion.poses.map((pose) => [pose.x, pose.y]);
  solutions.forEach((solution, k) => {
    const item = document.createElement("li");
    const button = document.createElement("button");
    button.type = "button";
    button.setAttribute("aria-pressed", String(k === rank));
    button.append(thumbnail(new Linkage(solution), span, targets));
    const name = document.createElement("span");
    name.className = "name";
    name.textContent = `${solution.rank}. ${FAMILIES[solution.family] ?? solution.family}`;
    const facts = document.createElement("dl");
    const rows = [
      ["angle error", small(solution.errors.rotation_rms, 57, "°")],
      ["place error", small(solution.errors.position_rms, reply.report.length_scale ?? 1)],
      ["transmission", `${text(solution.transmission_angle_min, 3)}°`],
    ];
    for (const [term, value] of rows) {
      if (value === null) continue;
      facts.append(Object.assign(document.createElement("dt"), { textContent: term }), Object.assign(document.createElement("dd"), { textContent: value }));
    }
    button.append(name, facts);
    button.addEventListener("click", () => chooseSolution(k));
    item.append(button);
    list.append(item);
  });
  const { report } = reply;
  $("results-note").textContent = `errors are rms over the poses · ${Math.round(report.elapsed_ms.total)} ms`;
  $("trace-note").textContent = [`Search ended: ${{ tolerance: "tolerance reached", converged: "nothing better in reach", budget: "time is up" }[report.stopped_by]}.`, ...report.notes.map((note) => `Note: ${note}.`)].join(" ");
  chooseSolution(rank);
  drawTrace();
}

function chooseSolution(k) {
  rank = k;
  const solution = found.reply.solutions[k];
  [...$("solutions").children].forEach((item, j) => item.firstChild.setAttribute("aria-pressed", String(j === k)));
  const { motion } = found;
  const linkage = new Linkage(solution);
  const span = motion.direction * motion.span * RAD;
  const steps = Math.min(1440, Math.max(180, Math.ceil(motion.span)));
  const used = linkage.over(0, span, steps);
  const turn = linkage.turnsFully ? linkage.over(0, motion.direction * 2 * Math.PI, 360) : null;
  const angles = travels(motion).map((t) => motion.direction * t * RAD);
  const at = angles.map((t) => linkage.at(t));
  const errors = linkage.mount && motion.wanted !== "rotation"
    ? motion.poses.map((pose, j) => [[pose.x, pose.y], at[j]?.p ?? [pose.x, pose.y]]) : null;
  watched = { solution, linkage, span, used, turn, angles, at, errors };
  $("range").querySelector("[value=turn]").disabled = !turn;
  if (!turn) $("range").value = "used";
  board.showLinkage(watched);
  board.fit();
  setRange();
  showNumbers();
  drawCurves();
}

// -- watch -------------------------------------------------------------------------------------------------------------

let timer = null, moment = null, heading = 1, charts = [];

const wholeTurn = () => $("range").value === "turn";

function setRange() {
  const last = wholeTurn() ? Math.sign(watched.span) * 360 : watched.span / RAD;
  const slider = $("slider");
  slider.dataset.last = last;
  slider.max = Math.abs(last);
  if (Number(slider.value) > Math.abs(last)) slider.value = 0;
  showTravel();
}

function showTravel() {
  if (!watched) return;
  const way = Math.sign(watched.span);
  const degrees = way * Number($("slider").value);
  const joints = watched.linkage.at(degrees * RAD);
  $("travel").value = `${degrees.toFixed(1)}°`;
  $("slider").setAttribute("aria-valuetext", `crank turned by ${degrees.toFixed(1)} degrees`);
  board.showJoints(joints);
  for (const one of charts) one.mark(Math.abs(degrees));
}

function play() {
  if (!watched) return;
  if (!wholeTurn() && Number($("slider").value) >= Number($("slider").max)) $("slider").value = 0;
  heading = 1;
  moment = performance.now();
  const button = $("play");
  button.setAttribute("aria-label", "Pause");
  button.querySelector("path").setAttribute("d", "M5.5 3.5h3v13h-3zM11.5 3.5h3v13h-3z");
  const frame = (now) => {
    const slider = $("slider"), max = Number(slider.max);
    // once over the range in four seconds; back and forth over an interval, round and round over a turn
    let value = Number(slider.value) + (heading * (now - moment) * Number($("speed").value) * max) / 4000;
    moment = now;
    if (wholeTurn()) value %= max;
    else if (value >= max) [value, heading] = [max, -1];
    else if (value <= 0 && heading < 0) [value, heading] = [0, 1];
    slider.value = value;
    showTravel();
    timer = requestAnimationFrame(frame);
  };
  timer = requestAnimationFrame(frame);
}

function pause() {
  if (timer !== null) cancelAnimationFrame(timer);
  timer = null;
  const button = $("play");
  button.setAttribute("aria-label", "Play");
  button.querySelector("path").setAttribute("d", "M6 3.5v13l11-6.5z");
}

function drawCurves() {
  if (!watched || $("curves-card").hidden) return;
  const { angles, at, linkage, span } = watched;
  const { motion } = found;
  const last = wholeTurn() ? Math.sign(span) * 2 * Math.PI : span;
  const count = 240;
  const fine = Array.from({ length: count + 1 }, (_, k) => (last * k) / count);
  const inside = angles.filter((t) => Math.abs(t) <= Math.abs(last) * (1 + 1e-12));
  const all = [...new Set([...fine, ...inside])].sort((a, b) => Math.abs(a) - Math.abs(b));
  const joints = all.map((t) => linkage.at(t));
  const where = new Map(angles.map((t, k) => [t, k]));
  const atSamples = (value) => all.map((t) => (where.has(t) ? value(where.get(t)) : null));
  const over = (value) => joints.map((j) => (j ? value(j) : null));
  const x = all.map((t) => Math.abs(t) / RAD); // a clockwise crank is drawn from left to right, too
  const host = $("curves");
  host.replaceChildren();
  charts = [];
  const add = (title, summary, series, more = {}) => {
    const block = document.createElement("div");
    block.append(Object.assign(document.createElement("h3"), { textContent: title }));
    const box = document.createElement("div");
    box.className = "chart";
    box.setAttribute("role", "img");
    box.setAttribute("aria-label", `${title}: ${summary}`);
    block.append(box);
    host.append(block);
    charts.push(chart(box, { x, series, ...more }));
  };
  const bounds = (values) => {
    const good = values.filter((v) => v !== null);
    return `from ${text(Math.min(...good), 4)} to ${text(Math.max(...good), 4)}`;
  };
  const rotation = over((j) => j.rotation / RAD);
  const rotationSeries = [{ values: rotation, colour: "body" }];
  if (motion.wanted !== "position") rotationSeries.push({ values: atSamples((k) => motion.poses[k].angle), colour: "pose", points: true });
  add(motion.wanted === "position" ? "Rotation of the coupler, degrees" : "Rotation of the body, degrees (dots: wanted)", bounds(rotation), rotationSeries, { degreesY: true, height: 160 });
  const off = watched.errors?.map(([from, to]) => Math.hypot(to[0] - from[0], to[1] - from[1]));
  if (off) add("Position error at the poses", bounds(off), [{ values: atSamples((k) => off[k]), colour: "bad", points: true }, { values: over(() => 0), colour: "line" }], { height: 130 });
  else if (motion.wanted === "rotation") {
    const wrong = at.map((j, k) => (j ? motion.poses[k].angle - j.rotation / RAD : 0));
    add("Rotation error at the poses, degrees", bounds(wrong), [{ values: atSamples((k) => wrong[k]), colour: "bad", points: true }], { height: 130 });
  }
  const transmission = over((j) => j.transmission / RAD);
  const least = motion.limits.transmission;
  add(`Transmission angle, degrees${least ? " (dashed: limit)" : ""}`, bounds(transmission), [{ values: transmission, colour: "path" }, ...(least ? [{ values: x.map(() => least), colour: "box", dash: [6, 4], width: 1.2 }] : [])], { height: 160, degreesY: true, range: [0, 90], splits: [0, 30, 60, 90] });
  for (const one of charts) one.mark(Number($("slider").value));
}

function drawTrace() {
  const box = $("trace");
  if (!found || $("trace-card").hidden) return;
  const { report } = found.reply;
  const trace = report.trace.map(([ms, objective]) => [ms, Math.max(objective, 1e-17)]);
  if (!trace.length) { box.replaceChildren(); return; }
  trace.push([Math.max(report.elapsed_ms.total, trace.at(-1)[0] * 1.001), trace.at(-1)[1]]);
  box.setAttribute("aria-label", `Best error after each round: ${report.trace.slice(-6).map(([ms, objective]) => `${text(objective, 2)} after ${text(ms, 3)} ms`).join(", ")}`);
  chart(box, {
    x: trace.map(([ms]) => ms), height: innerWidth <= 900 ? 170 : Math.max(170, Math.min(box.clientHeight, 360)), degreesX: false, logY: true, xName: " ms",
    series: [{ values: trace.map(([, objective]) => objective), colour: "accent", steps: true, size: 5 }],
  });
}

// -- numbers and files -------------------------------------------------------------------------------------------------

/** Names and values of a solution, with so many digits. */
function numberRows(solution, digits) {
  const { links, mount } = solution;
  const rows = [
    ["Crank", text(links.crank, digits)], ["Coupler", text(links.coupler, digits)], ["Rocker", text(links.rocker, digits)], ["Ground", text(links.ground, digits)],
    ["Branch", solution.branch > 0 ? "+1" : "−1"], ["Start angle", `${text(solution.start_angle, digits)}°`],
  ];
  if (solution.body_offset !== null) rows.push(["Body offset", `${text(solution.body_offset, digits)}°`]);
  if (mount) {
    rows.push(
      ["Pivot A", `${text(mount.pivot_a[0], digits)}, ${text(mount.pivot_a[1], digits)}`],
      ["Pivot B", `${text(mount.pivot_b[0], digits)}, ${text(mount.pivot_b[1], digits)}`],
      ["Ground angle", `${text(mount.ground_angle, digits)}°`],
      ["Coupler point", `${text(mount.coupler_point.radius, digits)} at ${text(mount.coupler_point.angle, digits)}°`],
    );
  }
  const { errors } = solution;
  if (errors.rotation_max !== null) rows.push(["Angle error, largest", `${text(errors.rotation_max, 4)}°`]);
  if (errors.position_max !== null) rows.push(["Place error, largest", text(errors.position_max, 4)]);
  rows.push(["Transmission", `${text(solution.transmission_angle_min, 5)}°`]);
  if (solution.transmission_angle_min_turn !== null) rows.push(["Transmission, whole turn", `${text(solution.transmission_angle_min_turn, 5)}°`]);
  const { rounded } = solution;
  if (rounded?.closes) rows.push(["Rounded links", ["crank", "coupler", "rocker", "ground"].map((name) => text(rounded.links[name], 8)).join(", ")], ["Error when rounded", rounded.errors.position_rms === null ? `${text(rounded.errors.rotation_rms, 3)}°` : text(rounded.errors.position_rms, 3)]);
  else if (rounded) rows.push(["Rounded links", "do not close"]);
  return rows;
}

function showNumbers() {
  const table = document.createElement("table");
  for (const [name, value] of numberRows(watched.solution, 8)) {
    const row = table.insertRow();
    const head = document.createElement("th");
    head.scope = "row";
    head.textContent = name;
    row.append(head);
    row.insertCell().textContent = value;
  }
  $("numbers").replaceChildren(table);
  if (watched.solution.determination.ill_posed) {
    $("numbers").append(Object.assign(document.createElement("p"), { className: "note", textContent: "Quite different linkages make this motion about as well: its lengths are not fixed by it." }));
  }
  $("export-note").textContent = "";
}

async function copy(content, done) {
  try {
    await navigator.clipboard.writeText(content);
    $("export-note").textContent = done;
  } catch {
    $("export-note").textContent = content;
  }
}

async function save(format) {
  $("export-note").textContent = `Making ${format.toUpperCase()}…`;
  try {
    const reply = await ask("/v1/export", { request: found.request, solution: watched.solution, format, length_unit: $("length-unit").value });
    const name = `linkage-${watched.solution.rank}.${format === "mjcf" ? "xml" : format}`;
    download(await reply.blob(), name);
    $("export-note").textContent = `Saved ${name}.`;
  } catch (error) { $("export-note").textContent = error.message; }
}

async function makeLink() {
  const url = new URL(location.href);
  url.hash = await toFragment(found?.request && !board.stale ? found.request : toRequest(history.value));
  ownFragment = url.hash;
  window.history.replaceState(null, "", url);
  await copy(url.href, "The link is copied; it holds the whole request.");
}

function bindWatch() {
  $("slider").addEventListener("input", () => { pause(); showTravel(); });
  $("range").addEventListener("change", () => { setRange(); drawCurves(); });
  $("play").addEventListener("click", () => (timer === null ? play() : pause()));
  $("copy").addEventListener("click", () => copy(numberRows(watched.solution, 17).map((row) => row.join("\t")).join("\n"), "The numbers are copied."));
  for (const button of document.querySelectorAll("[data-format]")) button.addEventListener("click", () => save(button.dataset.format));
  $("link").addEventListener("click", makeLink);
  $("print").addEventListener("click", () => print());
  redrawOn($("curves"), drawCurves);
  redrawOn($("trace"), drawTrace);
  $("form").addEventListener("submit", (event) => { event.preventDefault(); solveNow(); });
  $("stop").addEventListener("click", () => { stopSearch(); say(found ? "Stopped; these are the best found so far." : "Stopped."); });
}

async function start() {
  startTheme();
  startScenes();
  bindForm();
  bindFiles();
  bindWatch();
  motionChanged();
  try {
    examples = await (await fetch("/static/examples.json")).json();
  } catch { say("The examples cannot be loaded.", true); }
  for (const { name, title } of examples) $("example").append(new Option(title, name));
  let linked = false, damaged = null;
  try { linked = await openLink(); } catch (error) { damaged = error.message; }
  if (!linked && examples.length && !history.value.poses.length) loadExample(examples[0].name);
  history.past = [];
  motionChanged();
  board.fit();
  if (damaged) say(damaged, true);
  document.body.dataset.ready = "true";
  if (linked) solveNow();
}

start();
