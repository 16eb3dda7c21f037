// An answer as an engineer reads it: key figures, tables, curves over a shared axis; and every other number in tables.

import { redrawOn, titledChart } from "./charts.js";
import { element, tableOf, text } from "./drawing.js";
import { build, counted } from "./shell.js";

const ROWS = 1000; // rows of a table that are shown; files hold all
const LONG = 60; // letters of a cell that is written in several lines
const LISTED = 8; // numbers that are written in one line

const heading = (title) => build("h3", {}, title);
const named = (name, unit) => (unit ? [name, " ", element("span", "unit", unit)] : [name]);

/** A value in words: numbers to `digits` digits. */
function words(value, digits = 7) {
  if (value === null || value === undefined) return "–";
  if (typeof value === "number") return text(value, digits);
  if (typeof value === "boolean") return value ? "yes" : "no";
  return Array.isArray(value) ? value.map((part) => words(part, digits)).join(", ") || "none" : String(value);
}

/** Key figures in `host`: rows [name, value, unit]; `title` stands above them. */
export function facts(host, rows, title = "") {
  const row = ([name, value, unit]) =>
    build("div", {}, build("dt", {}, name), build("dd", {}, named(words(value), unit)));
  host.append(...(title ? [heading(title)] : []), build("dl", { className: "facts" }, rows.map(row)));
}

/** A sentence in `host`. */
export function note(host, sentence) {
  host.append(element("p", "note", sentence));
}

/** An element in `host` that scrolls when it is wider than the page. */
export function scrolling(host, title, content) {
  host.append(build("div", { className: "scroll", tabIndex: 0, role: "region", "aria-label": title }, content));
}

/** A table in `host`: `columns` are names or [name, unit], `rows` lists of values; the first column names its row. */
export function table(host, title, columns, rows) {
  const head = columns.map((column) => (typeof column === "string" ? column : named(...column))),
    cells = rows.slice(0, ROWS).map((row) => row.map((value) => words(value))),
    cellTable = tableOf(head, cells, true);
  for (const cell of cellTable.querySelectorAll("td, th"))
    cell.classList.toggle("long", cell.textContent.length > LONG);
  host.append(heading(title));
  scrolling(host, title, cellTable);
  if (rows.length > ROWS) note(host, `The first ${ROWS} of ${rows.length} rows; the files hold all.`);
}

/**
 * Curves in `host`, one below the other, over the abscissas `x`, whose unit `xUnit` stands at the axis. `list` holds
 * {title, unit, values, colour} or, for several curves in one chart, {title, unit, series: [{values, colour, dash}]}.
 * Returns `mark(value)`, which moves a line along all of them.
 */
export function curves(host, { x, xUnit = "", list }) {
  const block = element("div", list.length > 1 ? "curves-list" : "curves-list one"),
    axis = { x, degreesX: xUnit === "°", xName: xUnit && xUnit !== "°" ? ` ${xUnit}` : "" };
  let charts = [],
    at = null;
  const mark = (value) => {
    at = value;
    for (const chart of charts) chart.mark(value);
  };
  const draw = () => {
    block.replaceChildren();
    charts = list.map(({ title, unit, values, colour = "body", series = [{ values, colour }], ...more }) =>
      titledChart(block, unit ? `${title}, ${unit}` : title, { ...axis, series, ...more }),
    );
    if (at !== null) mark(at);
  };
  host.append(block);
  draw();
  redrawOn(block, draw);
  return mark;
}

const isObject = (value) => value !== null && typeof value === "object" && !Array.isArray(value);
const isNumbers = (value) => value.length > 0 && value.every((part) => part === null || typeof part === "number");
const isPoints = (value) =>
  value.length > 1 && value.every((part) => Array.isArray(part) && isNumbers(part) && part.length === value[0].length);
const spaced = (path) => path.replaceAll("_", " ");

/** A flat row {name: value} of an object in an object. */
function flat(value, name = "") {
  const inner = (part) => Object.values(flat(part)).map((cell) => words(cell));
  if (Array.isArray(value) && value.some((part) => part !== null && typeof part === "object"))
    return { [name]: value.map((part) => inner(part).join(" ")).join("; ") };
  if (!isObject(value)) return { [name]: value };
  return Object.assign({}, ...Object.entries(value).map(([key, part]) => flat(part, name ? `${name} · ${key}` : key)));
}

/** Every number of a reply in `host`: single ones as figures, lists of one length as the columns of one table. */
export function everything(host, reply) {
  const single = [],
    columns = new Map(),
    tables = [];
  const column = (path, values) =>
    columns.set(values.length, [...(columns.get(values.length) ?? []), [spaced(path), values]]);
  const walk = (value, path) => {
    if (isObject(value)) for (const [key, part] of Object.entries(value)) walk(part, path ? `${path} · ${key}` : key);
    else if (!Array.isArray(value)) single.push([spaced(path), value]);
    else if (isPoints(value) && value[0].length <= 4)
      for (const k of value[0].keys()) {
        const values = value.map((part) => part[k]);
        column(`${path} ${"xyzw"[k]}`, values);
      }
    else if (value.length && value.every(isObject)) tables.push([path, value.map((row) => flat(row))]);
    else if (isNumbers(value) && value.length > LISTED) column(path, value);
    else if (value.some((part) => part && typeof part === "object"))
      for (const [k, part] of value.entries()) walk(part, `${path} ${k + 1}`);
    else single.push([spaced(path), value]);
  };
  walk(reply, "");
  if (single.length) facts(host, single);
  for (const [path, rows] of tables) {
    const names = [...new Set(rows.flatMap((row) => Object.keys(row)))],
      cells = rows.map((row, k) => [k + 1, ...names.map((name) => row[name])]);
    table(host, spaced(path), ["", ...names.map(spaced)], cells);
  }
  for (const [count, group] of columns) {
    const names = group.map(([name]) => name),
      rows = Array.from({ length: Math.min(count, ROWS + 1) }, (_, k) => [k + 1, ...group.map(([, list]) => list[k])]);
    table(host, counted(count, "row"), ["", ...names], rows);
  }
}
