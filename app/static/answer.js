// An answer as an engineer reads it: key figures, tables, curves over a shared axis; and every other number in tables.

import { titledChart } from "./charts.js";
import { text } from "./drawing.js";
import { build, counted } from "./shell.js";

const ROWS = 1000; // rows of a table that are shown; files hold all
const LONG = 60; // letters of a cell that is written in several lines
const LISTED = 8; // numbers that are written in one line

const heading = (title) => build("h3", { textContent: title });

/** A value in words: numbers to `digits` digits. */
function words(value, digits = 7) {
  if (value === null || value === undefined) return "–";
  if (typeof value === "number") return text(value, digits);
  if (typeof value === "boolean") return value ? "yes" : "no";
  return Array.isArray(value) ? value.map((part) => words(part, digits)).join(", ") || "none" : String(value);
}

/** Key figures in `host`: rows [name, value, unit]; `title` stands above them. */
export function facts(host, rows, title = "") {
  const list = build("dl", { className: "facts" });
  for (const [name, value, unit] of rows) {
    const shown = build("dd", { textContent: words(value) });
    if (unit) shown.append(" ", build("span", { className: "unit", textContent: unit }));
    list.append(build("div", {}, build("dt", { textContent: name }), shown));
  }
  host.append(...(title ? [heading(title)] : []), list);
}

/** A sentence in `host`. */
export function note(host, sentence) {
  host.append(build("p", { className: "note", textContent: sentence }));
}

/** A table in `host`: `columns` are names or {name, unit}, `rows` lists of values; the first column names its row. */
export function table(host, title, columns, rows) {
  const body = build("tbody"),
    head = build("tr");
  for (const column of columns) {
    const { name, unit } = typeof column === "string" ? { name: column } : column,
      top = build("th", { scope: "col", textContent: name });
    if (unit) top.append(" ", build("span", { className: "unit", textContent: unit }));
    head.append(top);
  }
  const cell = (value, k) => {
    const shown = words(value);
    return build(k ? "td" : "th", {
      textContent: shown,
      className: shown.length > LONG ? "long" : "",
      ...(k ? {} : { scope: "row" }),
    });
  };
  for (const row of rows.slice(0, ROWS)) body.append(build("tr", {}, ...row.map(cell)));
  const scroll = build("div", { className: "scroll", tabIndex: 0 }, build("table", {}, build("thead", {}, head), body));
  scroll.setAttribute("role", "region");
  scroll.setAttribute("aria-label", title);
  host.append(heading(title), scroll);
  if (rows.length > ROWS) note(host, `The first ${ROWS} of ${rows.length} rows; the files hold all.`);
}

const drawn = new Map();
const width = (block) => block.clientWidth;

const resized = new ResizeObserver((entries) => {
  for (const { target } of entries) {
    const curve = drawn.get(target);
    if (curve && width(target) && curve.width !== width(target)) curve.draw();
  }
});
document.addEventListener("themechange", () => {
  for (const [block, curve] of drawn) {
    if (block.isConnected) curve.draw();
    else drawn.delete(block);
  }
});

/**
 * Curves in `host`, one below the other, over the abscissas `x`, whose unit `xUnit` stands at the axis. `list` holds
 * {title, unit, values, colour} or, for several curves in one chart, {title, unit, series: [{values, colour, dash}]}.
 * Returns `mark(value)`, which moves a line along all of them.
 */
export function curves(host, { x, xUnit = "", list }) {
  const block = build("div", { className: list.length > 1 ? "curves-list" : "curves-list one" });
  let charts = [],
    at = null;
  const mark = (value) => {
    at = value;
    for (const chart of charts) chart.mark(value);
  };
  const curve = {
    width: 0,
    draw() {
      block.replaceChildren();
      curve.width = width(block);
      charts = list.map(({ title, unit, values, colour = "body", series = [{ values, colour }], ...more }) =>
        titledChart(block, unit ? `${title}, ${unit}` : title, {
          x,
          series,
          degreesX: xUnit === "°",
          xName: xUnit && xUnit !== "°" ? ` ${xUnit}` : "",
          ...more,
        }),
      );
      if (at !== null) mark(at);
    },
  };
  host.append(block);
  for (const old of [...drawn.keys()]) if (!old.isConnected) drawn.delete(old);
  drawn.set(block, curve);
  curve.draw();
  resized.observe(block);
  return mark;
}

const isNumbers = (value) =>
  Array.isArray(value) && value.length > 0 && value.every((part) => part === null || typeof part === "number");
const isRows = (value) =>
  Array.isArray(value) &&
  value.length > 0 &&
  value.every((part) => part && typeof part === "object" && !Array.isArray(part));
const isPoints = (value) =>
  Array.isArray(value) &&
  value.length > 0 &&
  value.every((part) => isNumbers(part) && part.length === value[0].length && part.length <= 4);
const said = (path) => path.replaceAll("_", " ");

/** A flat row {name: value} of an object in an object. */
function flat(value, name = "") {
  if (value === null || typeof value !== "object") return { [name]: value };
  if (Array.isArray(value))
    return {
      [name]: value.every((part) => typeof part !== "object" || part === null)
        ? value
        : value
            .map((part) =>
              Object.values(flat(part))
                .map((inner) => words(inner))
                .join(" "),
            )
            .join("; "),
    };
  return Object.assign(
    {},
    ...Object.entries(value).map(([key, inner]) => flat(inner, name ? `${name} · ${key}` : key)),
  );
}

/** Every number of a reply in `host`: single ones as figures, lists of one length as the columns of one table. */
export function everything(host, reply) {
  const single = [],
    columns = new Map(),
    tables = [];
  const column = (path, values) => {
    const group = columns.get(values.length) ?? [];
    columns.set(values.length, [...group, [said(path), values]]);
  };
  const walk = (value, path) => {
    if (value === null) single.push([said(path), null]);
    else if (isPoints(value) && value.length > 1)
      value[0].forEach((_, k) =>
        column(
          `${path} ${"xyzw"[k]}`,
          value.map((part) => part[k]),
        ),
      );
    else if (isRows(value)) tables.push([path, value.map((row) => flat(row))]);
    else if (isNumbers(value) && value.length > LISTED) column(path, value);
    else if (Array.isArray(value) && value.some((part) => part && typeof part === "object"))
      value.forEach((part, k) => walk(part, `${path} ${k + 1}`));
    else if (typeof value === "object" && !Array.isArray(value))
      for (const [key, inner] of Object.entries(value)) walk(inner, path ? `${path} · ${key}` : key);
    else single.push([said(path), value]);
  };
  walk(reply, "");
  if (single.length) facts(host, single);
  for (const [path, rows] of tables) {
    const names = [...new Set(rows.flatMap((row) => Object.keys(row)))];
    table(
      host,
      said(path),
      ["", ...names.map(said)],
      rows.map((row, k) => [k + 1, ...names.map((name) => row[name])]),
    );
  }
  for (const [count, group] of columns)
    table(
      host,
      counted(count, "row"),
      ["", ...group.map(([name]) => name)],
      Array.from({ length: Math.min(count, ROWS + 1) }, (_, k) => [k + 1, ...group.map(([, values]) => values[k])]),
    );
}
