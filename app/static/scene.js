// A machine's page: a form for each of its queries, the reply as a picture and as a table of numbers.

import { text } from "./drawing.js";
import { buildForm } from "./form.js";
import { picture } from "./pictures.js";
import { ask, download } from "./service.js";
import { $, say, startScenes, startTheme } from "./shell.js";

let scene = null, query = null, read = null, answered = null, turn = 0;

function chooseQuery(path) {
  query = scene.queries.find((one) => one.path === path);
  $("query").value = path;
  $("summary").textContent = query.summary;
  $("example").replaceChildren(...Object.keys(query.examples).map((name) => new Option(name.replaceAll("_", " "), name)));
  chooseExample(Object.keys(query.examples)[0]);
}

function chooseExample(name) {
  read = buildForm($("fields"), query.schema, query.examples[name] ?? {});
  answer();
}

/** The request with the points that the picture needs, for queries that can include them. */
function withExtras(request) {
  const include = query.schema.properties?.include;
  if (!include) return request;
  return { ...request, include: [...new Set([...(request.include ?? []), "points"])] };
}

async function answer() {
  const mine = ++turn;
  let request;
  try {
    request = withExtras(read());
  } catch (error) {
    say(error.message, true);
    return;
  }
  say("Computing…");
  $("run").disabled = true;
  try {
    const begin = performance.now();
    const reply = await (await ask(query.path, request)).json();
    if (mine !== turn) return;
    answered = { request, reply };
    say(`Answered in ${Math.round(performance.now() - begin)} ms.`);
    showNumbers(reply);
    showExports();
    $("picture-card").hidden = false;
    const some = await picture($("picture"), query, request, reply);
    if (mine === turn) $("picture-card").hidden = !some;
  } catch (error) {
    if (mine === turn) say(error.message, true);
  } finally {
    if (mine === turn) $("run").disabled = false;
  }
}

const isNumbers = (value) => Array.isArray(value) && value.every((part) => typeof part === "number");

const isFlat = (value) => value && typeof value === "object" && !Array.isArray(value) && Object.values(value).every((part) => part === null || typeof part !== "object");
const words = (value) => (typeof value === "number" ? text(value, 8) : String(value));

/** Rows [name, text] of a reply; the names of lists too long for a row are added to `long`. */
function rows(value, long, name = "") {
  if (value === null) return [];
  if (Array.isArray(value)) {
    if (!value.length) return [[name, "none"]];
    if (isNumbers(value) && value.length <= 8) return [[name, value.map(words).join(", ")]];
    if (value.every((part) => typeof part === "string")) return [[name, value.join(", ")]];
    if (value.length <= 8 && value.every(isFlat)) return value.map((part, k) => [`${name} ${k + 1}`, Object.entries(part).map(([key, inner]) => `${key.replaceAll("_", " ")} ${words(inner)}`).join(", ")]);
    if (value.length <= 12 && value.every((part) => isNumbers(part) && part.length <= 4)) return [[name, value.map((part) => `(${part.map(words).join(", ")})`).join(" ")]];
    long.push(`${name} (${value.length})`);
    return [];
  }
  if (typeof value === "object") return Object.entries(value).flatMap(([part, inner]) => rows(inner, long, name ? `${name} · ${part}` : part));
  return [[name, typeof value === "number" ? text(value, 10) : String(value)]];
}

function showNumbers(reply) {
  const table = document.createElement("table");
  const long = [];
  const found = rows(reply, long);
  if (long.length) found.push(["lists, in the JSON file", long.join(", ").replaceAll("_", " ")]);
  for (const [name, value] of found) {
    const row = table.insertRow();
    row.append(Object.assign(document.createElement("th"), { scope: "row", textContent: name.replaceAll("_", " ") }));
    row.insertCell().textContent = value;
  }
  $("answer").replaceChildren(table);
  $("answer-card").hidden = false;
}

function showExports() {
  const { request, reply } = answered;
  const name = query.command.replaceAll(" ", "-");
  const button = (format, save) => {
    const made = Object.assign(document.createElement("button"), { type: "button", textContent: format.toUpperCase() });
    made.dataset.format = format;
    made.addEventListener("click", () => save().catch((error) => say(error.message, true)));
    return made;
  };
  $("exports").replaceChildren(
    button("json", async () => download(new Blob([JSON.stringify({ request, reply }, null, 1)], { type: "application/json" }), `${name}.json`)),
    ...query.exports.map((format) => button(format, async () => download(await (await ask(`${query.path}.${format}`, request)).blob(), `${name}.${format}`))),
  );
}

async function start() {
  startTheme();
  const name = location.pathname.split("/").filter(Boolean).at(-1);
  startScenes(name);
  scene = await (await fetch(`/scenes/${name}/queries`)).json();
  document.title = `${scene.title} · linkage-atlas`;
  $("title").textContent = scene.title;
  $("query").replaceChildren(...scene.queries.map((one) => new Option(one.command.split(" ").slice(1).join(" "), one.path)));
  $("query").addEventListener("change", () => chooseQuery($("query").value));
  $("example").addEventListener("change", () => chooseExample($("example").value));
  $("form").addEventListener("submit", (event) => { event.preventDefault(); answer(); });
  document.addEventListener("themechange", () => { if (answered) picture($("picture"), query, answered.request, answered.reply).catch(() => {}); });
  chooseQuery(scene.queries[0].path);
  document.body.dataset.ready = "true";
}

start().catch((error) => say(error.message, true));
