// A machine's page: the question as a form, the answer as drawing, figures, curves and tables, files and a link.

import { everything } from "./answer.js";
import { chain } from "./chain.js";
import { button } from "./drawing.js";
import { buildForm } from "./form.js";
import { fromFragment, toFragment } from "./link.js";
import { knotter } from "./knotter.js";
import { lift } from "./lift.js";
import { ask, download } from "./service.js";
import { $, copy, listen, markEarlier, say, startScenes, startTheme } from "./shell.js";
import { Visits } from "./visits.js";

/**
 * Exports of a machine's module: `show(answer, hosts)`, which draws an answer {query, request, reply, ask} into the
 * elements of `hosts` (picture, facts, curves, tables) and may return the player of its drawing; and, if its drawing
 * needs more than was asked for, `request(query, request)`, what is sent instead, and `numbers(reply)`, without it.
 */
const MACHINES = { lift, chain, knotter };
const HOSTS = ["picture", "facts", "curves", "tables"];

const CHOSEN = "Press Calculate to see the result.";
/** Purpose of each machine, the meaning of its result, and the parts in its picture. */
const CASES = {
  lift: [
    "A pneumatic cylinder pushes a corner of a rigid triangle, and the triangle lifts a platform along a " +
      "vertical slide. Change the lengths, the cylinder and the load; the result is the motion of the platform " +
      "and its forces.",
    "A is the platform on its slide, B the end of the cylinder l₁ from the pivot O, and C the end of the " +
      "link l₅ from the pivot D.",
  ],
  chain: [
    "A chain of constant pitch runs around a crescent of two arcs with a wheel at each end. Its links are " +
      "chords of the track, so that a shallow slot in the upper arc must take up the slack; the result is the " +
      "shape of this slot.",
    "One pin hangs freely between its neighbours in the upper arc, and its path is the shape of the slot.",
  ],
  knotter: [
    "The knotter of a baler ties a rope with a disc that holds it and a bill that turns it into a loop. " +
      "Change the directions of both axes, alpha1 and alpha3; the result says whether the knot is tied, and " +
      "with which margins.",
    "S₀ is the point of the disc that holds the rope, and S₁ the point where the needle lays it; the rope " +
      "crosses the bill at E₁ and the edge S₈S₉ of the jaw at E₂.",
  ],
};

let [scene, machine, query, form] = [null, null, null, null]; // of this page
let [answered, running, player] = [null, null, null]; // the answer on show, the work that runs, the drawing's player
let own = ""; // the fragment of the address of this page's own answer
let edited = false; // whether the form has changed since it was sent

const visits = new Visits(showAgain, () => {}); // the question of the address is sent by `hashchange`

function chooseQuery(path) {
  query = scene.queries.find((entry) => entry.path === path);
  $("query").value = path;
  $("summary").textContent = query.summary;
  const options = Object.keys(query.examples).map((name) => new Option(name.replaceAll(/[_-]/g, " "), name));
  $("example").replaceChildren(...options);
}

function fill(request) {
  form = buildForm($("fields"), query.schema, request);
}

/** Fills the form with an example, which is not calculated yet. */
function chooseExample(name) {
  $("example").value = name;
  fill(query.examples[name] ?? {});
  if (answered) markEarlier((edited = true));
  if (!running) say(CHOSEN);
}

/** Show the button that stops a running search, in the service too. */
function busy(now) {
  $("stop").hidden = !now;
  $("form").setAttribute("aria-busy", String(now));
}

/**
 * Runs `work(get)`, where `get(path, body)` asks the service, until other work begins or Stop is pressed: then `get`
 * throws AbortError, so that only the latest work draws. Returns whether the work came to its end.
 */
async function run(question, work) {
  const current = Object.assign(new AbortController(), { question }),
    asking = form;
  running?.abort();
  running = current;
  edited = false;
  busy(true);
  try {
    await work(async (path, body) => (await ask(path, body, current.signal)).json());
    current.signal.throwIfAborted();
    markEarlier(edited);
    say(answered.words);
    return true;
  } catch (error) {
    if (running !== current) return false;
    markEarlier(edited || answered?.request !== question.request);
    if (form === asking) form.mark(error.rows ?? []);
    if (error.name === "AbortError") say("Stopped.");
    else say(error.message, true);
    return false;
  } finally {
    if (running === current) {
      running = null;
      busy(false);
    }
  }
}

/** Sends the question in the form; `at` is the position of the slider of a link. */
async function answer(at = null) {
  let request = null;
  try {
    request = form.read();
  } catch (error) {
    say(error.message, true);
    return;
  }
  const question = { query: query.path, request },
    begin = performance.now(),
    current = query;
  if (running && JSON.stringify(question) === JSON.stringify(running.question)) return;
  say("Calculating…");
  const complete = await run(question, async (get) => {
    const sent = machine.request?.(current, request) ?? request,
      reply = await get(current.path, sent),
      words = `Calculated in ${Math.round(performance.now() - begin)} ms.`;
    answered = { query: current, request, sent, reply, words };
    await show(at, get);
  });
  const shown = answered,
    fragment = await toFragment(question);
  if (!complete || answered !== shown) return;
  own = fragment;
  visits.add(question, { ...answered, own }, `#${own}`);
}

/** Shows an answer of this page again, with its question in the form. */
function showAgain(earlier) {
  own = earlier.own;
  if (query !== earlier.query) chooseQuery(earlier.query.path);
  fill(earlier.request);
  answered = earlier;
  return run({ query: earlier.query.path, request: earlier.request }, (get) => show(null, get));
}

/** Draws the answer, for whose drawing `get` may ask the service. */
async function show(at, get) {
  const hosts = Object.fromEntries(HOSTS.map((name) => [name, $(name)]));
  for (const name of HOSTS) {
    hosts[name].replaceChildren();
    $(`${name}-card`).hidden = false; // what is drawn needs its width
  }
  $("all").replaceChildren();
  $("all-fold").open = false;
  showExports();
  player = (await machine.show({ ...answered, ask: get }, hosts)) ?? null;
  if (at !== null) player?.go(at);
  for (const name of HOSTS) $(`${name}-card`).hidden = !hosts[name].childElementCount && name !== "facts";
}

function showExports() {
  const { query: answeredQuery, request, sent, reply } = answered,
    name = answeredQuery.command.replaceAll(" ", "-"),
    type = "application/json";
  const json = () => new Blob([JSON.stringify({ request: sent, reply }, null, 1)], { type }),
    fetchFile = async (format) => (await ask(`${answeredQuery.path}.${format}`, request)).blob();
  const save = async (format) => {
    try {
      download(await (format === "json" ? json() : fetchFile(format)), `${name}.${format}`);
    } catch (error) {
      say(error.message, true);
    }
  };
  const saves = (format) => button(format.toUpperCase(), () => save(format), "", { "data-format": format });
  $("exports").replaceChildren(...["json", ...answeredQuery.exports].map(saves));
}

/** The page's address with the question, its values and the place of the slider behind #. */
async function copyLink() {
  const link = new URL(location.href);
  link.hash = await toFragment({ query: answered.query.path, request: answered.request, at: player?.value });
  await copy(link.href, "The link is copied. It restores the question, its values and the place of the slider.");
}

/** The question in the page's address; false if it holds none. */
async function openLink() {
  const saved = await fromFragment(location.hash);
  if (!saved) return false;
  if (!scene.queries.some((entry) => entry.path === saved.query))
    throw new Error("The link belongs to another machine or version.");
  chooseQuery(saved.query);
  fill(saved.request);
  await answer(saved.at ?? null);
  return true;
}

async function start() {
  const begin = performance.now();
  startTheme();
  const name = location.pathname.split("/").filter(Boolean).at(-1);
  startScenes(name);
  machine = MACHINES[name];
  scene = await (await fetch(`/scenes/${name}/queries`)).json();
  document.title = `${scene.title} · linkage-atlas`;
  $("title").textContent = scene.title;
  [$("purpose").textContent, $("caption").textContent] = CASES[name];
  const options = scene.queries.map((entry) => new Option(entry.command.split(" ").slice(1).join(" "), entry.path)),
    change = () => markEarlier((edited = true)),
    showError = (error) => say(error.message, true);
  $("query").replaceChildren(...options);
  listen("query", "change", () => {
    chooseQuery($("query").value);
    chooseExample($("example").value);
  });
  listen("example", "change", () => chooseExample($("example").value));
  listen("fields", "input", change);
  listen("fields", "click", ({ target }) => target.type === "button" && change()); // rows that come and go
  listen("form", "submit", (event) => {
    event.preventDefault();
    answer();
  });
  listen("run", "click", (event) => event.detail > 1 && !edited && event.preventDefault()); // a double click asks once
  listen("stop", "click", () => {
    running?.abort();
    $("run").focus();
  });
  listen("link", "click", () => copyLink().catch(showError));
  listen("all-fold", "toggle", () => {
    const { reply } = answered;
    if ($("all-fold").open && !$("all").childElementCount) everything($("all"), machine.numbers?.(reply) ?? reply);
  });
  addEventListener("hashchange", () => location.hash !== `#${own}` && openLink().catch(showError));
  chooseQuery(scene.queries[0].path);
  let wrong = null;
  const opened = await openLink().catch((error) => {
    wrong = error;
  });
  if (!opened) {
    chooseExample($("example").value);
    await answer();
  }
  if (wrong) say(wrong.message, true);
  performance.measure("first answer", { start: begin });
  document.body.dataset.ready = "true";
}

start().catch((error) => say(error.message, true));
