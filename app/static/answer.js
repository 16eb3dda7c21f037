// A reply as figures, curves and tables, which are found by the form of its values: single, over time, or in rows.

import { Charts } from "./charts.js";
import { element, tableOf, text } from "./drawing.js";
import { build, capital, spaced } from "./shell.js";

const ROWS = 1000; // rows of a table that are shown; files hold all
const LONG = 60; // letters of a cell that is written in several lines, or of a value that is a sentence
const LISTED = 16; // values of a list that are written in one line

const isObject = (value) => value !== null && typeof value === "object" && !Array.isArray(value);
const isNumbers = (list) => list.every((value) => value === null || typeof value === "number");
const isShort = (value) => !Array.isArray(value) || (value.length <= LISTED && !value.some(isObject));
const named = (name, unit) => (unit ? [name, " ", element("span", "unit", unit)] : [name]);
const titled = (path) => (path ? capital(spaced(path)) : "");

/** A value in words: numbers to 7 digits. */
function words(value) {
  if (value === null || value === undefined) return "–";
  if (typeof value === "number") return text(value, 7);
  if (typeof value === "boolean") return value ? "yes" : "no";
  if (Array.isArray(value)) return value.map(words).join(", ") || "none";
  return spaced(value).replace("<=max", " at most").replace(">=min", " at least");
}

/** A flat row {name: value} of an object in an object. */
function flat(value, name = "") {
  if (!isObject(value)) return { [name]: value };
  return Object.assign({}, ...Object.entries(value).map(([key, part]) => flat(part, name ? `${name} · ${key}` : key)));
}

/** The names in rows that have a value in one or more of them, first those of the rows themselves. */
function namesOf(rows) {
  const names = rows.flatMap((row) => Object.keys(row).filter((name) => row[name] !== null && isShort(row[name])));
  return [...new Set(names)].sort((first, second) => first.includes(" · ") - second.includes(" · "));
}

/** The names of an object's parts that are objects with the same single values, such as the conditions of a machine. */
function alike(value) {
  const fields = ([, part]) => (isObject(part) && Object.values(flat(part)).every(isShort) ? Object.keys(part) : []),
    groups = Map.groupBy(Object.entries(value), (entry) => fields(entry).join());
  groups.delete("");
  const [largest = []] = [...groups.values()].sort((a, b) => b.length - a.length);
  return largest.length > 1 ? largest.map(([name]) => name) : [];
}

/**
 * The parts of a reply: `groups` of single values by the path of their object, `columns` [path, values] of `count`
 * numbers, and `tables` [path, heads, rows]. Paths that match `hidden` are left out.
 */
function partsOf(reply, hidden, count) {
  const groups = new Map(),
    columns = [],
    tables = [];
  const addTable = (path, rows) => {
    const flatRows = rows.map((row) => flat(row)),
      names = namesOf(flatRows).filter((name) => !hidden.test(`${path} · ${name}`));
    tables.push([path, names, flatRows.map((row) => names.map((name) => row[name]))]);
  };
  /** Parts with the same values beside one another, a row for each value. */
  const addTwins = (path, value, twins) => {
    const rows = twins.map((twin) => flat(value[twin])),
      names = namesOf(rows).filter((name) => !hidden.test(name));
    tables.push([path, ["", ...twins], names.map((name) => [spaced(name), ...rows.map((row) => row[name])])]);
  };
  const walk = (value, path, parent, name) => {
    if (value === null || hidden.test(path)) return;
    const isList = Array.isArray(value);
    if (isObject(value)) {
      const twins = alike(value);
      if (twins.length) addTwins(path, value, twins);
      for (const [key, part] of Object.entries(value))
        if (!twins.includes(key)) walk(part, path ? `${path} · ${key}` : key, path, key);
    } else if (isList && value.length && value.every(isObject)) addTable(path, value);
    else if (isList && value.length === count && isNumbers(value)) columns.push([path, value]);
    else if (isShort(value) || value.every((part) => typeof part === "string"))
      groups.set(parent, [...(groups.get(parent) ?? []), [path, name, value]]);
  };
  walk(reply, "", "", "");
  return { groups, columns, tables };
}

function facts(host, title, rows, unitOf) {
  const ofNumber = (path, value) => (typeof value === "number" ? unitOf(path) : ""),
    inWords = rows.map(([path, name, value]) => [spaced(name), words(value), ofNumber(path, value)]),
    isSentence = ([, value]) => value.length > LONG,
    pair = ([name, value, unit]) => build("div", {}, build("dt", {}, name), build("dd", {}, named(value, unit)));
  const figures = inWords.filter((row) => !isSentence(row)).map(pair),
    notes = inWords.filter(isSentence).map(([name, value]) => element("p", "note", `${name}: ${value}`));
  host.append(...(title ? [build("h3", {}, title)] : []), build("dl", { className: "facts" }, figures), ...notes);
}

function table(host, title, names, rows, unitOf) {
  const cells = rows.slice(0, ROWS).map((row) => row.map(words)),
    heads = names.map((name) => named(spaced(name), unitOf(name))),
    cellTable = tableOf(heads, cells, true),
    more = rows.length > ROWS && element("p", "note", `The first ${ROWS} of ${rows.length} rows; the files hold all.`);
  for (const cell of cellTable.querySelectorAll("td, th"))
    cell.classList.toggle("long", cell.textContent.length > LONG);
  const scroll = { className: "scroll", tabIndex: 0, role: "region", "aria-label": title || "Table" };
  host.append(...[title && build("h3", {}, title), build("div", scroll, cellTable), more].filter(Boolean));
}

/** Curves in `host` over the abscissas `x`; returns what moves a line along all of them. */
function curves(host, columns, x, xUnit, unitOf) {
  const block = element("div", "curves-list"),
    axis = { x, degreesX: xUnit === "°", xName: xUnit === "°" ? "" : ` ${xUnit}` },
    titleOf = (path) => [titled(path), unitOf(path)].filter(Boolean).join(", ");
  host.append(block);
  const charts = new Charts(block, () =>
    columns.map(([path, values]) => [titleOf(path), { ...axis, series: [{ values, colour: "body" }] }]),
  );
  charts.draw();
  return (value) => charts.mark(value);
}

/**
 * Shows a reply in `hosts` {facts, curves, tables}. Lists as long as that at the first path of `over` which the reply
 * has become curves over it; paths that match `hidden` are left out, and `unitOf` gives the unit of a path. Returns
 * what moves a line along the curves.
 */
export function showReply(hosts, reply, { over, hidden, unitOf }) {
  const valueAt = (path) => path.split(" · ").reduce((part, name) => part?.[name], reply),
    abscissa = over.find(valueAt),
    x = abscissa ? valueAt(abscissa) : [],
    isRising = x.length > 1 && x.every((value, k) => !k || value > x[k - 1]),
    { groups, columns, tables } = partsOf(reply, hidden, isRising ? x.length : null);
  // first what is on top, then what the curves are of
  const rank = (parent) => (parent === "" ? 0 : abscissa?.startsWith(parent) ? 1 : 2),
    inOrder = [...groups].sort(([first], [second]) => rank(first) - rank(second));
  for (const [parent, rows] of inOrder) facts(hosts.facts, titled(parent), rows, unitOf);
  for (const [path, ...content] of tables) table(hosts.tables, titled(path), ...content, unitOf);
  const ordinates = columns.filter(([path]) => path !== abscissa);
  return ordinates.length ? curves(hosts.curves, ordinates, x, unitOf(abscissa), unitOf) : () => {};
}
