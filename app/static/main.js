// The four-bar page: sends the edited motion to the search, and shows the answers and the search's state.

import { startNumbers } from "./decimal.js";
import { Draft } from "./draft.js";
import { Editor } from "./editor.js";
import { startEntry } from "./entry.js";
import { startFunction } from "./function.js";
import { alike } from "./fit.js";
import { fromPage, fromRequest, requestText, toPage, toRequest } from "./formats.js";
import { Gallery } from "./gallery.js";
import { assessed } from "./follow.js";
import { fromHere } from "./hand.js";
import { enter, entriesOf, toFragment } from "./link.js";
import { isTable, lawAnswer, lawFault, pairs } from "./law.js";
import { Live } from "./live.js";
import { fault, wantsAngles } from "./motion.js";
import { startProjects } from "./projects.js";
import { Results, note } from "./results.js";
import { howNear, sentenceOf, showOffers } from "./sentence.js";
import { STAGES, ask, refine, solve, together } from "./service.js";
import { fillSheet } from "./sheet.js";
import { $, copy, listen, markEarlier, say, startScenes, startTheme } from "./shell.js";
import { Sources } from "./sources.js";
import { startStage } from "./extras.js";
import { startTeaching } from "./teach.js";
import { fold, focusOn, isNarrow, openStep, startSteps } from "./steps.js";
import { explainTerms } from "./terms.js";
import { defects } from "./verdict.js";
import { leaveWelcome, showWelcome, startWelcome } from "./welcome.js";
import { Visits, readdress } from "./visits.js";

/** Fields that describe a linkage in a link. */
const FOUR_BAR = "links start_angle body_offset mount family branch crank_angle";
const GUIDED = "kind driver guides start travel branch crank_angle";
const NOT_REACHED =
  "No linkage within the limits was reached from there; this does not prove that there is none. " +
  "Move it, or loosen a limit.";
const ADDRESS_MS = 300; // after which the page's address follows a change

let answer = null; // the last answer: {request, reply, motion, stored}
let running = null; // AbortController of the search that runs
let passed = false; // a later search has not brought anything in the place of the last answer
let addressing = null; // timer of the page's address
let linkedCard = null; // the card that a link chose, until the search for it has ended

const editor = new Editor(
  motionChanged,
  pathDrawn,
  { hand: jointDragged, pivot: pivotDragged },
  { get: asShown, put: putBack },
);
const results = new Results(
  editor.board,
  (kind) => editor.keep(kind),
  () => {
    if (!running) sayAnswer();
    addressSoon();
  },
);
const showLaw = startFunction(
  (change, kind) => editor.history.change(change, kind),
  () => editor.history.settle(),
);
pairs.changed = () => editor.refresh();
const sources = new Sources(() => editor.motion, useMotion);
const draft = new Draft("linkage-atlas-motion", (content) => sources.openDraft(content), beginAnew);
const gallery = new Gallery(
  (name) => sources.useExample(name),
  (law) => {
    sources.begin("function", law);
    startSearch();
  },
);
const live = new Live(editor, results, { fits, display, answer: () => answer, stop: stopSearch, say: sayAnswer });
const visits = new Visits(showAgain, (question) => {
  const { motion, card } = fromPage(question);
  useMotion(motion, { card, fit: false });
  startSearch();
});

function pathDrawn(points, closed) {
  sources.useDrawn(points, closed);
  editor.board.reveal();
}

function jointDragged(joint, position) {
  const hinders = results.drag(joint, position);
  if (hinders) editor.board.tell(hinders);
}

function pivotDragged(joint, position) {
  live.pull(joint, position);
  updateStale();
  editor.board.draw();
}

function asShown() {
  return { answer, state: results.state };
}

function fits(stored) {
  return Boolean(stored) && JSON.stringify(toRequest(editor.motion)) === JSON.stringify(stored.request);
}

/** Brings back, with an earlier motion, the answer that was shown with it, and its linkage as it was by hand. */
function putBack({ answer: shown, state }) {
  if (shown !== answer) {
    if (!fits(shown) && fits(answer)) return;
    stopSearch();
    live.forget();
    [answer, passed] = [shown, false];
    results.show(answer, true);
  } else if (state?.hand === results.state?.hand) return;
  if (state) results.restore(state);
}

/** Makes an entry of the browser's history of the answer that is shown. */
function visit() {
  visits.add(toPage(answer.request, answer.motion), answer);
  addressSoon();
}

/** Return the state that a link or a project restores: the motion, the selected linkage, and the entries of Build. */
function pageContent() {
  const card = chosenCard(),
    { request, motion } = card ? answer : { request: toRequest(editor.motion), motion: editor.motion };
  return { ...toPage(request, motion, card), build: entriesOf($("build")) };
}

/** The page's address with all that it shows. */
async function showAddress() {
  const { href } = location,
    hash = `#${await toFragment(pageContent())}`;
  if (location.href === href) readdress(hash);
  return location.href;
}

/** Lets the page's address hold the solved state soon; once the motion is another one, it holds nothing. */
function addressSoon() {
  clearTimeout(addressing);
  if (answer && !editor.board.stale)
    addressing = setTimeout(() => answer && !editor.board.stale && showAddress(), ADDRESS_MS);
  else if (/^#(path$|function$|[zj]=)/.test(location.hash) && sources.isOwn(editor.motion)) readdress("");
}

/** Shows an answer of this page again, with its motion. */
function showAgain(earlier, left) {
  useMotion(structuredClone(earlier.motion), { fit: false });
  [answer, passed] = [earlier, false];
  updateStale();
  results.show(earlier, true);
  if (left) editor.replace(fromPage(left).motion, false);
  editor.board.draw();
  sayAnswer();
}

function sayAnswer() {
  const { reply, motion, within } = answer,
    { solution } = results,
    [best] = reply.solutions,
    { unit, outline, note: origin } = editor.motion;
  if (editor.board.stale) say("Inputs changed. Solve again.");
  else if (solution?.source === "hand")
    say(`Changed by hand: ${howNear({ reply: { ...reply, solutions: [solution] }, motion })}.`);
  else {
    say(sentenceOf(answer, solution), !best || defects(best.verdict).length > 0);
    if (within) return;
    showOffers(answer, (eased) => {
      editor.replace({ ...fromRequest(eased), unit, outline, note: origin }, false);
      startSearch();
    });
  }
}

function updateStale() {
  editor.board.stale = Boolean(answer) && !fits(answer) && !live.motion;
  markEarlier(editor.board.stale || passed || Boolean(live.motion));
}

/** Keeps a motion of the user's own as the draft. */
function keepDraft() {
  const { motion } = editor,
    own = sources.isOwn(motion),
    content = toPage(toRequest(motion), motion);
  draft.see(content, own);
  visits.leave(content);
  addressSoon();
}

function showRequest() {
  const { motion } = editor;
  $("request-path").textContent = motion.law ? "/v2/function" : "/v2/synthesize";
  if (!$("request").open) return;
  const request = toRequest(motion);
  $("request-text").textContent = request ? requestText(request) : lawFault(motion)[0];
}

/** Update the page after a change of the motion; with `isDragging` only the parts that are drawn in every frame. */
function motionChanged(isDragging = false) {
  showLaw(editor.motion);
  live.change(editor.history.kind);
  updateStale();
  if (isDragging) return;
  showRequest();
  sources.say(editor.motion);
  keepDraft();
  const kind = editor.motion.law ? "function" : wantsAngles(editor.motion) ? "motion" : "path";
  for (const name of ["motion", "path", "function"])
    $(`new-${name}`).setAttribute("aria-pressed", String(name === kind));
  if (answer && answer.motion.unit !== editor.motion.unit) {
    answer.motion.unit = editor.motion.unit;
    results.show(answer, true);
  }
  $("suggestions").hidden ||= editor.board.stale || Boolean(live.motion);
  if (running || live.motion) return;
  if (!answer) say("");
  else if (editor.board.stale || !passed) sayAnswer();
}

function display(shown, solution) {
  [answer, passed] = [shown, false];
  updateStale();
  results.show(answer, true);
  results.choose(solution);
  editor.board.draw();
  sayAnswer();
}

function useMotion(motion, { mode = null, fit = true, reply = null, card = null, build }) {
  live.forget();
  enter($("build"), build);
  linkedCard = card;
  const first = leaveWelcome();
  stopSearch();
  $("suggestions").hidden = true;
  if (mode) editor.setMode(mode);
  editor.replace(motion, fit, () => {
    [answer, passed] = [null, false];
    results.show(null);
  });
  if (first) editor.forgetPast();
  say("");
  if (!reply) {
    openStep("motion");
    fold(Boolean(mode) && !motion.poses.length && !motion.law);
    return;
  }
  openStep("choose");
  answer = { request: toRequest(motion), reply, motion: structuredClone(motion), stored: true };
  visit();
  results.show(answer);
  if (card) results.choose(card);
  results.player.run();
  updateStale();
  editor.board.draw();
  sayAnswer();
}

function stopSearch() {
  running?.abort();
  running = null;
  $("stop").hidden = true;
  $("progress").hidden = true;
}

/** Shows the search's progress against the longest time that it may take; returns what ends that. */
function startProgress(begin) {
  const progress = $("progress"),
    longest = STAGES.reduce((sum, budget) => sum + budget);
  $("stop").hidden = false;
  $("suggestions").hidden = true;
  progress.hidden = false;
  progress.value = 0;
  say("Searching…");
  const timer = setInterval(() => {
    progress.value = Math.min(1, Math.sqrt((performance.now() - begin) / longest));
  }, 100);
  return () => clearInterval(timer);
}

/** The motion as it is, or null after saying what is wrong with it. */
function soundMotion() {
  const motion = structuredClone(editor.motion),
    wrong = editor.fault ?? (motion.law ? lawFault(motion) : fault(motion));
  if (!wrong) return motion;
  const [sentence, id] = wrong;
  say(sentence, true);
  focusOn($(id));
  return null;
}

/** Runs what asks the service, `work(control, begin)`, with Stop and progress; what ran before ends. */
async function run(work) {
  live.forget();
  stopSearch();
  const control = new AbortController(),
    begin = performance.now(),
    before = answer;
  running = control;
  const endProgress = startProgress(begin);
  try {
    await work(control, begin);
  } catch (error) {
    if (error.name !== "AbortError")
      say(`${error.message}${answer === before ? "" : " What is shown was found before that."}`, true);
  } finally {
    endProgress();
    if (running === control) {
      running = null; // it has ended, so that there is nothing to abort
      linkedCard = null;
      stopSearch();
    }
    updateStale();
    editor.board.draw();
  }
}

/** Takes an answer that replaces the one on show; a `further` one belongs to the same question. */
function take(found, further = false) {
  [answer, passed] = [found, false];
  if (!further) visit();
  updateStale();
  results.show(answer, further);
}

/** Opens the cards of a first answer, with its linkage in motion. */
function present() {
  results.player.run();
  openStep("choose");
  if (["add", "path"].includes(editor.board.mode)) editor.setMode("move"); // a drag moves what was found
}

const secondsSince = (begin) => (performance.now() - begin) / 1000;

/** Searches for the linkages of a function. */
function searchFunction(motion) {
  const request = toRequest(motion);
  return run(async (control, begin) => {
    const reply = await (await ask("/v2/function", request, control.signal)).json();
    if (running !== control) return;
    take({ ...lawAnswer(motion, request, reply), seconds: secondsSince(begin) });
    if (reply.solutions.length) {
      present();
      const card = linkedCard && reply.solutions.find((solution) => alike(solution, linkedCard));
      if (card) results.choose(card);
    }
    sayAnswer();
  });
}

/** Searches for the motion. */
async function startSearch() {
  const { law } = editor.motion;
  if (law && isTable(law)) await pairs.read(law.table);
  const motion = soundMotion();
  if (!motion) return;
  passed ||= Boolean(answer);
  updateStale();
  if (motion.law) await searchFunction(motion);
  else await run((control, begin) => searchMotion(motion, control, begin));
}

async function searchMotion(motion, control, begin) {
  const request = toRequest(motion),
    state = {}; // one answer of all stages
  let further = false;
  const show = (reply, last) => {
    const found = reply.solutions.length > 0;
    if (running !== control) return;
    // what is shown stays until there is something in its place
    if (!found && !last) {
      say("Nothing within the limits yet. Still searching…");
      return;
    }
    const { hand } = (further && results.state) || {};
    if (hand) reply.solutions.push(hand);
    take(Object.assign(state, { request, reply, motion, last, seconds: secondsSince(begin) }), further);
    if (!further) {
      if (found) present();
      performance.measure("first result", { start: begin, end: performance.now() });
    }
    further ||= found;
    if (!last) say(`After ${Math.round(1000 * secondsSince(begin))} ms: ${howNear(answer)}. Still searching…`);
  };
  await solve(request, show, control.signal, alike);
  if (running !== control || !answer) return;
  if (further && linkedCard && answer.reply.solutions.length) results.choose(linkedCard);
  sayAnswer();
}

/** Lets the service refine the selected linkage; the result takes the place of the one changed by hand. */
async function startRefinement() {
  const motion = soundMotion(),
    begun = results.solution;
  if (!motion || !begun) return;
  const request = toRequest(motion),
    isFresh = !editor.board.stale,
    before = begun.errors.objective;
  await run(async (control, begin) => {
    const reply = await refine(fromHere(request, begun), control.signal),
      [refined] = reply.solutions;
    if (running !== control) return;
    if (!refined) {
      say(NOT_REACHED, true);
      return;
    }
    const earlier = isFresh ? answer.reply.solutions.filter((solution) => solution.source !== "hand") : [],
      seconds = secondsSince(begin);
    reply.solutions = together(request, earlier, reply, earlier.length + 1, alike);
    answer = { request, reply, motion, seconds, refined: true };
    visit();
    passed = false;
    updateStale();
    results.show(answer, true);
    results.choose(refined);
    const near = howNear({ reply: { ...reply, solutions: [refined] }, motion }),
      gained = !isFresh || refined.errors.objective < before * (1 - 1e-6);
    const parts = [
      `Refined from there: ${near}.`,
      !gained && "The refinement did not reduce the error.",
      reply.report.stopped_by === "budget" && `The time was up after ${seconds.toFixed(1)} s.`,
      "Linkages elsewhere were not searched.",
    ];
    say(parts.filter(Boolean).join(" "));
  });
}

/** Shows a linkage that the user entered, with the motion that it makes, as the service judges it. */
function showEntered({ motion, solution }) {
  useMotion(motion, { mode: isNarrow() ? "move" : "hand" });
  const request = toRequest(motion);
  return run(async (control, begin) => {
    const reply = await refine(fromHere(request, solution), control.signal);
    if (running !== control) return;
    if (!reply.solutions.length) reply.solutions.push(assessed(solution, motion).solution);
    take({ request, reply, motion: structuredClone(motion), seconds: secondsSince(begin), refined: true });
    results.player.goto(0);
    fold(true);
    requestAnimationFrame(() => editor.board.fit());
    say("The linkage as entered. Drag its joints, or type them, to change it.");
  });
}

/** The dimensions of the selected linkage for a link or a project; null if the inputs have changed since. */
function chosenCard() {
  if (!answer || editor.board.stale || !results.solution) return null;
  const names = results.solution.links ? FOUR_BAR : GUIDED,
    entries = names.split(" ").map((name) => [name, results.solution[name]]);
  return Object.fromEntries(entries.filter(([, value]) => value !== undefined));
}

/** Shows a project that was saved, and solves it anew. */
function openProject(content) {
  const { motion, card } = fromPage(content);
  useMotion(motion, { card, build: content.build });
  if (card) startSearch();
}

function bindButtons() {
  listen("form", "submit", (event) => {
    event.preventDefault();
    startSearch();
  });
  document.addEventListener("keydown", (event) => {
    if (event.key !== "Enter" || !(event.ctrlKey || event.metaKey)) return;
    event.preventDefault();
    startSearch();
  });
  addEventListener("hashchange", addressChanged);
  document.addEventListener("refinehere", startRefinement);
  listen("stop", "click", () => {
    stopSearch();
    $("solve").focus();
    say(answer?.reply.solutions.length ? "Stopped; these are the best found so far." : "Stopped.");
  });
  listen("request", "toggle", showRequest);
  listen("request-copy", "click", () => {
    const otherwise = "The browser does not allow copying; select the text instead.";
    copy(requestText(toRequest(editor.motion)), "The request is copied.", say, otherwise);
  });
  listen("link", "click", async () => {
    await copy(await showAddress(), "The link is copied; it holds the whole request and the chosen linkage.", note);
  });
  let withParts = false;
  addEventListener("beforeprint", () => fillSheet(answer, results.solution, results.driving, withParts));
  listen("print", "click", () => {
    withParts = true;
    print();
    withParts = false;
  });
}

/** Searches for the motion of the page's address; without one there is again what was there before. */
async function addressChanged() {
  try {
    if (history.state?.visit) return; // Back and Forward show it
    if (await sources.openLink()) solveLinked();
    else if (!location.hash && sources.linked) beginAnew();
  } catch (error) {
    say(error.message, true);
  }
}

/** Leaves an empty workspace for the first screen. */
function beginAnew() {
  sources.begin("both");
  showWelcome(draft, openProject);
}

/** Shows the draft of this tab, or else the first screen. */
function showFirst() {
  if (!draft.resumes || !draft.restore()) showWelcome(draft, openProject);
}

async function start() {
  startTheme();
  startNumbers();
  startScenes();
  bindButtons();
  explainTerms();
  startSteps();
  startEntry(() => editor.motion.unit, showEntered);
  startTeaching(editor.board, results.player);
  const change = (edit) => editor.history.change(edit);
  sources.stage = startStage(editor.board, change, (mode) => editor.setMode(mode));
  editor.refresh();
  await sources.loadExamples();
  gallery.show(sources.examples);
  let linked = false,
    damage = null;
  try {
    linked = await sources.openLink();
  } catch (error) {
    damage = error.message;
  }
  startWelcome(draft, openProject);
  startProjects(pageContent, say);
  if (!linked && !damage && !["#path", "#function"].includes(location.hash) && !editor.motion.poses.length) showFirst();
  editor.forgetPast();
  if (!answer) editor.board.fit();
  if (damage) say(damage, true);
  document.body.dataset.ready = "true";
  if (linked) solveLinked();
}

/** Solves the motion of a link, unless it is an example with an answer. */
function solveLinked() {
  if (!answer) startSearch();
}

start();
