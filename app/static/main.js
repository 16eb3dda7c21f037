// The four-bar page: sends the edited motion to the search, and shows the answers and the search's state.

import { Editor } from "./editor.js";
import { requestText, toRequest } from "./formats.js";
import { fault } from "./motion.js";
import { Results, copy } from "./results.js";
import { STAGES, solve } from "./service.js";
import { $, say, startScenes, startTheme } from "./shell.js";
import { Sources } from "./sources.js";
import { defects } from "./verdict.js";

const STATUS = {
  reached: "Solved: the best linkage makes the motion to within rounding.",
  closest: "No linkage was found that makes exactly this motion; these come closest.",
  infeasible: "No linkage was found within these limits.",
  unknown: "No linkage was found before the search was cut short, which proves nothing. Loosen a limit or try again.",
};

let answer = null; // the last answer: {request, reply, motion}
let running = null; // AbortController of the search that runs

const editor = new Editor(motionChanged, pathDrawn);
const results = new Results(editor.board);
const sources = new Sources(() => editor.motion, useMotion);

function sayStatus({ status, solutions, report }, request) {
  const wrong = defects(solutions[0]?.verdict);
  const sentence = status === "reached" && request.tolerances ? "Solved: the best linkage keeps the allowed errors at every sample." : STATUS[status];
  if (!solutions.length && report.notes.length) {
    say([sentence, ...report.notes.map((note) => `${note[0].toUpperCase()}${note.slice(1)}.`)].join(" "), true);
    return;
  }
  say(wrong.length ? `${sentence} But none is free of defects: see the verdicts.` : sentence, !solutions.length || wrong.length > 0);
}

function updateStale() {
  editor.board.stale = Boolean(answer) && JSON.stringify(toRequest(editor.motion)) !== JSON.stringify(answer.request);
}

function showRequest() {
  if ($("request").open) $("request-text").textContent = requestText(toRequest(editor.motion));
}

function motionChanged() {
  showRequest();
  updateStale();
  if (running) return;
  if (editor.board.stale) say("The motion has changed since it was solved.");
  else if (answer) sayStatus(answer.reply, answer.request);
}

function useMotion(motion, mode, fit) {
  answer = null;
  stopSearch();
  results.show(null);
  if (mode) editor.setMode(mode);
  editor.replace(motion, fit);
  say("");
}

function pathDrawn(places, closed) {
  sources.useDrawn(places, closed);
}

function stopSearch() {
  running?.abort();
  running = null;
  $("stop").hidden = true;
  $("progress").hidden = true;
  $("solve").disabled = false;
}

/** Shows the search's progress against the longest time that it may take; returns what ends that. */
function startProgress(begin) {
  const progress = $("progress"), longest = STAGES.reduce((sum, budget) => sum + budget);
  $("solve").disabled = true;
  $("stop").hidden = false;
  progress.hidden = false;
  progress.value = 0;
  say("Searching…");
  const timer = setInterval(() => { progress.value = Math.min(1, Math.sqrt((performance.now() - begin) / longest)); }, 100);
  return () => clearInterval(timer);
}

async function startSearch() {
  const motion = structuredClone(editor.motion);
  const wrong = fault(motion);
  if (wrong) {
    const [sentence, id] = wrong;
    say(sentence, true);
    $(id)?.focus?.();
    return;
  }
  stopSearch();
  const request = toRequest(motion);
  const control = new AbortController();
  running = control;
  const begin = performance.now();
  const endProgress = startProgress(begin);
  let further = false;
  try {
    await solve(request, (reply, last) => {
      if (running !== control) return;
      answer = { request, reply, motion };
      editor.board.stale = false;
      results.show(answer, further);
      if (!further) performance.measure("first result", { start: begin, end: performance.now() });
      further = true;
      if (!last) say(`Best so far after ${Math.round(performance.now() - begin)} ms; still searching…`);
    }, control.signal);
    if (running === control && answer) sayStatus(answer.reply, answer.request);
  } catch (error) {
    if (error.name !== "AbortError") say(error.message, true);
  } finally {
    endProgress();
    if (running === control) {
      running = null; // it has ended, so that there is nothing to abort
      stopSearch();
    }
    updateStale();
    editor.board.draw();
  }
}

function bindButtons() {
  $("form").addEventListener("submit", (event) => { event.preventDefault(); startSearch(); });
  $("stop").addEventListener("click", () => { stopSearch(); say(answer ? "Stopped; these are the best found so far." : "Stopped."); });
  $("request").addEventListener("toggle", showRequest);
  $("request-copy").addEventListener("click", async () => {
    const content = requestText(toRequest(editor.motion));
    try {
      await navigator.clipboard.writeText(content);
      say("The request is copied.");
    } catch { say("The browser does not allow copying; select the text instead.", true); }
  });
  $("link").addEventListener("click", async () => {
    const request = answer && !editor.board.stale ? answer.request : toRequest(editor.motion);
    await copy(await sources.linkTo(request), "The link is copied; it holds the whole request.");
  });
}

async function start() {
  startTheme();
  startScenes();
  bindButtons();
  editor.refresh();
  await sources.loadExamples();
  let linked = false, damage = null;
  try { linked = await sources.openLink(); } catch (error) { damage = error.message; }
  if (!linked && !editor.motion.poses.length) sources.useExample(sources.examples[0]?.name);
  editor.forgetPast();
  editor.board.fit();
  if (damage) say(damage, true);
  document.body.dataset.ready = "true";
  if (linked) startSearch();
}

start();
