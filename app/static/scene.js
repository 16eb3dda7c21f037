// A machine's page: the question as a form, the answer as drawing, figures, curves and tables, files and a link.

import { showReply } from "./answer.js";
import { chain } from "./chain.js";
import { button } from "./drawing.js";
import { buildForm } from "./form.js";
import { fromFragment, toFragment } from "./link.js";
import { knotter } from "./knotter.js";
import { lift } from "./lift.js";
import { seldom } from "./play.js";
import { ask, download } from "./service.js";
import { $, copy, listen, markEarlier, say, startScenes, startTheme } from "./shell.js";
import { Visits } from "./visits.js";

/**
 * Exports of a machine's module: `purpose` and `caption`, its texts; `over`, `hidden` and `unitOf`, which describe its
 * replies to `showReply`; `drawing(answer)`, the question [path, body] whose reply is drawn instead of that of the
 * answer; and `draw(host, answer, follow)`, which draws an answer {query, request, reply, drawn} and returns the player
 * of the drawing, whose moves `follow` hears of, or null.
 */
const MACHINES = { lift, chain, knotter };
const HOSTS = ["picture", "facts", "curves", "tables"];

const CHOSEN = "Press Calculate to see the result.";

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

/** Ends the work that runs, if any, in favour of `next`. */
function takeOver(next) {
  const before = running;
  running = next;
  before?.abort();
  busy(next !== null);
}

/** Sends the question in the form, and shows the answer unless other work begins or Stop is pressed. */
async function answer(at = null) {
  const [current, asking, begin] = [query, form, performance.now()];
  let request = null;
  try {
    request = form.read();
  } catch (error) {
    say(error.message, true);
    return;
  }
  const question = { query: current.path, request };
  if (running && JSON.stringify(question) === JSON.stringify(running.question)) return;
  const control = Object.assign(new AbortController(), { question }),
    get = async (path, body) => (await ask(path, body, control.signal)).json();
  takeOver(control);
  edited = false;
  say("Calculating…");
  try {
    const reply = await get(current.path, request),
      more = machine.drawing?.({ query: current, request, reply }),
      drawn = more ? await get(...more) : reply,
      fragment = await toFragment(question);
    control.signal.throwIfAborted();
    own = fragment;
    answered = { query: current, request, reply, drawn, own };
    answered.words = `Calculated in ${Math.round(performance.now() - begin)} ms.`;
    show(at);
    markEarlier(edited);
    say(answered.words);
    visits.add(question, answered, `#${own}`);
  } catch (error) {
    if (running !== control) return;
    markEarlier(edited || answered?.request !== request);
    if (form === asking) form.mark(error.rows ?? []);
    const isStopped = error.name === "AbortError";
    say(isStopped ? "Stopped." : error.message, !isStopped);
  } finally {
    if (running === control) takeOver(null);
  }
}

/** Shows an answer of this page again, with its question in the form. */
function showAgain(earlier) {
  takeOver(null);
  own = earlier.own;
  if (query !== earlier.query) chooseQuery(earlier.query.path);
  fill(earlier.request);
  answered = earlier;
  show(null);
  markEarlier((edited = false));
  say(answered.words);
}

/** Shows the answer; `at` is the position of the slider of a link. */
function show(at) {
  const hosts = Object.fromEntries(HOSTS.map((name) => [name, $(name)]));
  for (const name of HOSTS) {
    hosts[name].replaceChildren();
    $(`${name}-card`).hidden = false; // what is drawn needs its width
  }
  showExports();
  const { reply, request } = answered,
    marks = [],
    follow = seldom((value) => marks.forEach((mark) => mark(value)));
  player = machine.draw(hosts.picture, answered, follow);
  const unitOf = (path) => machine.unitOf(path, reply, request);
  marks.push(showReply(hosts, reply, { ...machine, unitOf }));
  if (player) player.go(at ?? player.value);
  for (const name of HOSTS) $(`${name}-card`).hidden = !hosts[name].childElementCount && name !== "facts";
}

function showExports() {
  const { query: answeredQuery, request, reply } = answered,
    name = answeredQuery.command.replaceAll(" ", "-"),
    type = "application/json";
  const json = () => new Blob([JSON.stringify({ request, reply }, null, 1)], { type }),
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
  $("purpose").textContent = machine.purpose;
  $("caption").textContent = machine.caption;
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
