// Code that both pages share: elements by id, the status line, light or dark colours, links to the machines.

const KEY = "linkage-atlas-theme";
const system = matchMedia("(prefers-color-scheme: dark)");

/** Words as they begin a sentence. */
export const capital = (words) => words[0].toUpperCase() + words.slice(1);

/** The name of a field or link of the service in words. */
export const spaced = (name) => String(name).replaceAll("_", " ");

/** A number with its noun: "1 row", "2 rows". */
export const counted = (count, noun) => `${count} ${noun}${count === 1 ? "" : "s"}`;

export const $ = (id) => document.getElementById(id);

/** Calls `act` at events of an element; `events` are names with spaces between them. */
export function listen(id, events, act) {
  for (const name of events.split(" ")) $(id).addEventListener(name, act);
}

/** Arrow keys in the element `id` lead from one of its `items()` to the next, which `choose(item)` takes. */
export function rove(id, items, choose) {
  listen(id, "keydown", ({ key }) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[key],
      all = items();
    if (!step) return;
    const next = all[(all.indexOf(document.activeElement) + step + all.length) % all.length];
    next.focus();
    choose(next);
  });
}

/** The items that are there, with commas between them. */
export const listed = (...items) => items.filter(Boolean).join(", ");

/** An HTML element with properties or attributes, and children. */
export function build(name, properties = {}, ...children) {
  const node = document.createElement(name);
  for (const [key, value] of Object.entries(properties))
    if (key in node) node[key] = value;
    else node.setAttribute(key, value);
  node.append(...children.flat().filter((child) => child || child === 0));
  return node;
}

/** The value of plain data at a path as "limits.min". */
export const valueAt = (data, path) => path.split(".").reduce((part, name) => part[name], data);

/** Sets that value. */
export function setAt(data, path, value) {
  const names = path.split("."),
    last = names.pop();
  names.reduce((part, name) => part[name], data)[last] = value;
}

/** Writes the status line; `bad` marks an error. */
export function say(sentence, bad = false) {
  $("status").textContent = sentence;
  $("status").classList.toggle("bad", bad);
}

/** Puts `content` on the clipboard and tells that it is `done`; where the browser forbids it, tells `otherwise`. */
export async function copy(content, done, notify = say, otherwise = content) {
  try {
    await navigator.clipboard.writeText(content);
    notify(done);
  } catch {
    notify(otherwise);
  }
}

/** Marks what is shown of an answer as that of an earlier request, or takes the marks away. */
export function markEarlier(earlier) {
  document.body.classList.toggle("earlier", earlier);
  for (const mark of document.querySelectorAll("[data-earlier]")) mark.hidden = !earlier;
}

/** Plain data that the browser keeps under a name, for good or for the tab (`area`); null if there is none. */
export function recall(name, area = "localStorage") {
  try {
    return JSON.parse(window[area].getItem(name));
  } catch {
    return null; // the store is blocked or holds something else
  }
}

/** Keeps plain data under a name, or with null nothing; false if the browser does not allow it. */
export function keep(name, data, area = "localStorage") {
  try {
    if (data === null) window[area].removeItem(name);
    else window[area].setItem(name, JSON.stringify(data));
    return true;
  } catch {
    return false;
  }
}

function show(theme) {
  document.documentElement.dataset.theme = theme;
  document.dispatchEvent(new Event("themechange"));
}

const showPreferred = () => show(recall(KEY) ?? (system.matches ? "dark" : "light"));

/** Follows the system's colour scheme until the user presses the button; the choice is stored. */
export function startTheme() {
  showPreferred();
  system.addEventListener("change", showPreferred);
  $("theme").addEventListener("click", () => {
    const next = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
    keep(KEY, next);
    show(next);
  });
}

/** Adds links to the machines that this service offers; `current` is the machine of this page. */
export async function startScenes(current = null) {
  try {
    const scenes = await (await fetch("/scenes")).json();
    for (const { name, title } of scenes) {
      for (const host of document.querySelectorAll("[data-scenes]")) {
        const link = build("a", { href: `/scenes/${name}`, textContent: title });
        if (name === current) link.setAttribute("aria-current", "page");
        host.append(link, " ");
      }
    }
  } catch {
    /* without the list the page works, only the links are missing */
  }
}
