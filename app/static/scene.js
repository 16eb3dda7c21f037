// A machine's page: the question as a form, the answer as drawing, figures, curves and tables, files and a link.

import { everything } from "./answer.js";
import { chain } from "./chain.js";
import { button } from "./drawing.js";
import { buildForm } from "./form.js";
import { fromFragment, toFragment } from "./link.js";
import { knotter } from "./knotter.js";
import { lift } from "./lift.js";
import { ask, download } from "./service.js";
import { $, copy, markEarlier, say, startScenes, startTheme } from "./shell.js";
import { Visits } from "./visits.js";

/**
 * What a machine's module exports: `show(answer, hosts)`, which draws an answer {query, request, reply, ask} into the
 * elements of `hosts` (picture, facts, curves, tables) and may return the player of its drawing; and, if its drawing
 * needs more than was asked for, `request(query, request)`, what is sent instead, and `numbers(reply)`, the reply without it.
 */
const MACHINES = { lift, chain, knotter };
const HOSTS = ["picture", "facts", "curves", "tables"];

const CHOSEN = "Press Answer to compute it.";

let scene = null, machine = null, query = null, form = null, answered = null, running = null, run = null, own = "", edited = false;

const visits = new Visits(
  (earlier) => showAgain(earlier).catch((error) => say(error.message, true)),
  () => {}, // what the address asks is asked for by `hashchange`
);

function chooseQuery(path) {
  query = scene.queries.find((one) => one.path === path);
  $("query").value = path;
  $("summary").textContent = query.summary;
  $("example").replaceChildren(...Object.keys(query.examples).map((name) => new Option(name.replaceAll(/[_-]/g, " "), name)));
}

function fill(request) {
  form = buildForm($("fields"), query.schema, request);
}

/** Fills the form with an example; Answer asks it. */
function chooseExample(name) {
  $("example").value = name;
  fill(query.examples[name] ?? {});
  if (answered) markEarlier(edited = true);
  if (!running) say(CHOSEN);
}

/** While a search runs a button stops it, in the service too. */
function busy(now) {
  $("stop").hidden = !now;
  $("form").setAttribute("aria-busy", String(now));
}

async function answer(at = null) {
  const mine = new AbortController(), asking = form;
  let request = null;
  try {
    request = form.read();
    const question = { query: query.path, request };
    if (running && JSON.stringify(question) === JSON.stringify(running.question)) return; // as after a double click
    running?.abort();
    edited = false;
    const begin = performance.now();
    running = Object.assign(mine, { question });
    say("Computing…");
    busy(true);
    const asked = query, sent = machine.request?.(asked, request) ?? request;
    const get = async (path, body) => (await ask(path, body, mine.signal)).json();
    const reply = await get(asked.path, sent);
    answered = { query: asked, request, sent, reply, ask: get, words: `Answered in ${Math.round(performance.now() - begin)} ms.` };
    await show(answered, at);
    markEarlier(edited);
    say(answered.words);
    own = await toFragment(question);
    visits.add(question, { ...answered, own }, `#${own}`);
  } catch (error) {
    markEarlier(edited || answered?.request !== request);
    if (error.name === "AbortError") { if (running === mine) say("Stopped."); return; }
    if (form === asking) form.mark(error.rows ?? []);
    say(error.message, true);
  } finally {
    if (running === mine) [running] = [null, busy(false)];
  }
}

/** Shows an answer of this page again, with its question in the form. */
async function showAgain(earlier) {
  running?.abort();
  running = null;
  busy(false);
  own = earlier.own;
  if (query !== earlier.query) chooseQuery(earlier.query.path);
  fill(earlier.request);
  answered = earlier;
  await show(earlier, null);
  markEarlier(edited = false);
  say(earlier.words);
}

async function show(answer_, at) {
  const hosts = Object.fromEntries(HOSTS.map((name) => [name, $(name)]));
  for (const name of HOSTS) {
    hosts[name].replaceChildren();
    $(`${name}-card`).hidden = false; // what is drawn needs its width
  }
  $("all").replaceChildren();
  $("all-fold").open = false;
  showExports();
  run = (await machine.show(answer_, hosts)) ?? null;
  if (at !== null) run?.go(at);
  for (const name of HOSTS) $(`${name}-card`).hidden = !hosts[name].childElementCount && name !== "facts";
}

function showExports() {
  const { query: asked, request, sent, reply } = answered, name = asked.command.replaceAll(" ", "-");
  const saves = (format, save) => {
    const made = button(format.toUpperCase(), () => save().catch((error) => say(error.message, true)));
    made.dataset.format = format;
    return made;
  };
  $("exports").replaceChildren(
    saves("json", async () => download(new Blob([JSON.stringify({ request: sent, reply }, null, 1)], { type: "application/json" }), `${name}.json`)),
    ...asked.exports.map((format) => saves(format, async () => download(await (await ask(`${asked.path}.${format}`, request)).blob(), `${name}.${format}`))),
  );
}

/** The page's address with the question, its values and the place of the slider behind #. */
async function copyLink() {
  const link = new URL(location.href);
  link.hash = await toFragment({ query: answered.query.path, request: answered.request, at: run?.value });
  await copy(link.href, "The link is copied. It restores the question, its values and the place of the slider.");
}

/** The question in the page's address; false if it holds none. */
async function openLink() {
  const kept = await fromFragment(location.hash);
  if (!kept) return false;
  if (!scene.queries.some((one) => one.path === kept.query)) throw new Error("The link is of another machine or version.");
  chooseQuery(kept.query);
  fill(kept.request);
  await answer(kept.at ?? null);
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
  $("query").replaceChildren(...scene.queries.map((one) => new Option(one.command.split(" ").slice(1).join(" "), one.path)));
  $("query").addEventListener("change", () => { chooseQuery($("query").value); chooseExample($("example").value); });
  $("example").addEventListener("change", () => chooseExample($("example").value));
  const change = () => markEarlier(edited = true);
  $("fields").addEventListener("input", change);
  $("fields").addEventListener("click", ({ target }) => { if (target.type === "button") change(); }); // rows that come and go
  $("form").addEventListener("submit", (event) => { event.preventDefault(); answer(); });
  $("stop").addEventListener("click", () => { running?.abort(); $("run").focus(); });
  $("link").addEventListener("click", () => copyLink().catch((error) => say(error.message, true)));
  $("all-fold").addEventListener("toggle", () => { if ($("all-fold").open && !$("all").childElementCount) everything($("all"), machine.numbers?.(answered.reply) ?? answered.reply); });
  addEventListener("hashchange", () => { if (location.hash !== `#${own}`) openLink().catch((error) => say(error.message, true)); });
  chooseQuery(scene.queries[0].path);
  let wrong = null;
  const opened = await openLink().catch((error) => { wrong = error; });
  if (!opened) {
    chooseExample($("example").value);
    await answer();
  }
  if (wrong) say(wrong.message, true);
  performance.measure("first answer", { start: begin });
  document.body.dataset.ready = "true";
}

start().catch((error) => say(error.message, true));
