// A table of rows as typed or from a spreadsheet: what separates cells, marks of decimals and thousands, names of columns.

const FUNCTIONS = {
  otherwise: "even over “Crank turns”",
  columns: {
    input: "input", crank: "input", crank_angle: "input", theta1: "input", x: "x", y: "y",
    output: "output", rocker: "output", rocker_angle: "output", theta3: "output", psi: "output", angle: "output",
  },
  named: "input, output, x, y", known: "input and output, or x and y, are",
};
/** Tables of the function page where they have no names: of numbers, or of angles of crank and rocker. */
const TABLES = {
  table: { ...FUNCTIONS, wanted: "x, y", byNumber: { 2: ["x", "y"] } },
  pairs: { ...FUNCTIONS, wanted: "a crank angle and a rocker angle, or a rocker angle", byNumber: { 2: ["input", "output"], 1: ["output"] } },
};
const NUMBERING = ["no", "nr", "n", "id", "pose", "point", "sample", "index"]; // columns that count the rows, and are not read
const TIMES = ["t", "time"];
const SPELLED = { "°": "deg", degrees: "deg", degree: "deg", radians: "rad", inch: "in", inches: "in" };
const GREEK = { "θ": "theta", "φ": "phi", "ϕ": "phi", "γ": "gamma", "ψ": "psi" };

const cellsOf = (line, separator) => line.split(separator).map((cell) => cell.replace(/^"(.*)"$/, "$1"));

/** What separates cells, and whether decimals are marked by a comma: found from all lines of a file together. */
function readLayout(lines) {
  const all = (character) => lines.some((line) => line.includes(character)), layout = (separator) => [separator, marksDecimals(lines.flatMap((line) => cellsOf(line, separator)))];
  if (all(";")) return layout(/\s*;\s*/);
  if (all("\t")) return layout(/ *\t */);
  // "1,5 2,5": blanks separate and commas are decimal where no comma is followed by a blank
  if (all(",") && lines.every((line) => !/,\s|,$|^,|,,/.test(line) && (!line.includes(",") || /\S\s+\S/.test(line))) && lines.some((line) => /(^|\s)[-+]?\d+,\d/.test(line))) return layout(/\s+/);
  return all(",") ? [/\s*,\s*/, false] : [/\s+/, false];
}

/** Whether a comma marks decimals: the last of two different marks does, and one that does not stand before just three digits. */
function marksDecimals(cells) {
  const found = new Set(cells.flatMap((cell) => {
    const marks = cell.match(/[.,]/g) ?? [], last = marks.at(-1);
    if (!marks.length || new Set(marks).size > 1) return marks.slice(-1);
    if (marks.length > 1) return [last === "," ? "." : ","];
    return /^[-+]?[1-9]\d{0,2}[.,]\d{3}(\D|$)/.test(cell) ? [] : [last];
  }));
  if (found.size > 1) throw new Error("Some numbers have a decimal comma and others a decimal point.");
  return found.size ? found.has(",") : cells.some((cell) => /\d,\d/.test(cell));
}

/** A name of a column, as {name, unit, written}: "X [mm]", "x_mm" and "x in mm" are x in mm; null for a cell that is no name. */
function readName(cell) {
  const [, name, joined, behind] = /^([a-z][a-z0-9_]*?)(?:_(mm|cm|m|in|inch|deg|rad))?(?![a-z0-9_])\W*(?:in\W+(?=[a-z°]))?([a-z°]*)/i.exec(cell.trim().replace(/[θφϕγψ]/gi, (letter) => GREEK[letter.toLowerCase()])) ?? [];
  if (name === undefined) return null;
  const unit = (joined ?? behind).toLowerCase();
  return { name: name.toLowerCase(), unit: SPELLED[unit] ?? unit, written: name };
}

/** A number as spreadsheets show it (grouped thousands, a minus of its own, a degree sign) in plain characters. */
function plainNumber(cell, decimalComma) {
  const plain = cell.replace(/\s*°$/, "").replace("\u2212", "-").replace(/(?<=\d)[\u00a0\u202f\u2009'’](?=\d{3})/g, "").trim();
  const whole = plain.replace(decimalComma ? /(?<=\d)\.(?=\d{3}(\D|$))/g : /(?<=\d),(?=\d{3}(\D|$))/g, "");
  // a mark that is left of those that group stood at no place for one
  return decimalComma ? (whole.includes(".") ? plain : whole.replace(",", ".")) : whole;
}

/** {names, units, rows of cells, their lines} of a text. `columns`: what a column may be called; `byNumber`: what it is without names; the rest are words. */
export function readTable(text, { columns, named: naming, known, wanted, byNumber, otherwise }) {
  const filled = text.replace(/^\uFEFF/, "").split(/\r\n|\r|\n/).map((line, k) => [line.replace(/^ +| +$/g, ""), k + 1]).filter(([line]) => line.trim());
  if (/^sep=.$/.test(filled[0]?.[0])) filled.shift();
  const lines = filled.filter(([line]) => !line.startsWith("#"));
  if (!lines.length) throw new Error("There are no rows.");
  // a head may be separated otherwise than the rows
  const headOf = (first) => cellsOf(first, /[;\t,]/.test(first) ? /\s*[;\t,]\s*/ : /\s+(?![[(])/).map(readName), read = (one) => columns[one?.name] || NUMBERING.includes(one?.name);
  const note = filled[filled.indexOf(lines[0]) - 1]?.[0].replace(/^[# ]+/, "") ?? "", noted = headOf(note); // "# x, y, theta" above the rows
  if (noted.every(read) && noted.length === cellsOf(lines[0][0], /\s*[;\t]\s*|\s*,\s+|\s+/.test(lines[0][0]) ? /\s*[;\t]\s*|\s*,\s+|\s+/ : ",").length) lines.unshift([note, 0]);
  const named = /[a-zθφϕγψ]/i.test(lines[0][0].replace(/\d[eE][-+]?\d/g, ""));
  const [separator, decimalComma] = readLayout((named && lines.length > 1 ? lines.slice(1) : lines).map(([line]) => line));
  let names, units = [];
  if (named) {
    const head = headOf(lines.shift()[0]);
    const time = head.find((one) => TIMES.includes(one?.name));
    if (time) throw new Error(`The column '${time.written}' is a time, and no crank angle: name it 'crank' if it holds crank angles in degrees, or leave it out (then crank angles are ${otherwise}).`);
    if (!lines.length) throw new Error("There are no rows.");
    names = head.map((one) => one && columns[one.name]);
    units = head.map((one) => one?.unit ?? "");
    const unknown = head.find((one) => one && !read(one));
    if (unknown && names.some(Boolean)) throw new Error(`The first line names a column “${unknown.name}”, which is not known; ${known}.`);
    if (!names.some(Boolean)) throw new Error(`The first line names none of the columns ${naming}.`);
    const twice = names.findIndex((name, k) => name && names.indexOf(name) < k);
    if (twice >= 0) throw new Error(`Two columns of the first line mean the same: ${head[names.indexOf(names[twice])].name} and ${head[twice].name}.`);
  } else {
    names = byNumber[cellsOf(lines[0][0], separator).length];
    if (!names) throw new Error(`Each row must hold ${wanted}.`);
  }
  const rows = lines.map(([line]) => cellsOf(line, separator).map((cell) => plainNumber(cell, decimalComma)));
  return { names, units, rows, at: lines.map(([, line]) => line) };
}

/** The cells of lines of numbers without names of columns; a separator at the end of a line separates nothing. */
export function readCells(lines) {
  const ended = lines.map((line) => line.trim().replace(/\s*[,;]$/, "")), [separator, decimalComma] = readLayout(ended);
  return ended.map((line) => cellsOf(line, separator).map((cell) => plainNumber(cell, decimalComma)));
}

/** A number of a table in column `column` of a line; NaN for an empty cell where there may be one. */
export function readNumber(cell, line, column, empty = false) {
  const value = cell ? Number(cell) : NaN, large = Math.abs(value) > 1e50 && Number.isFinite(value);
  if ((large || !Number.isFinite(value)) && !(empty && !cell)) throw new Error(`Line ${line}, column ${column + 1}: '${cell.slice(0, 20)}' is ${large ? (value > 0 ? "more than 1e+50" : "less than -1e+50") : "not a number"}.`);
  return value;
}

/**
 * The columns of a function's table by their names, input and output or x and y, and whether its angles are in radians; `kind`,
 * "table" or "pairs", says what columns without names hold. Throws Error with the number of the line.
 */
export function functionTable(text, kind) {
  const { names, units, rows, at } = readTable(text, TABLES[kind]), found = {};
  for (const [k, name] of names.entries()) if (name) found[name] = rows.map((row, n) => readNumber(row[k] ?? "", at[n], k));
  if (found.x ? !found.y || found.output || found.input : !found.output || found.y) throw new Error("The columns must be input and output, or output, or x and y.");
  const angles = new Set(units.filter((_, k) => ["input", "output"].includes(names[k])).map((unit) => unit === "rad"));
  if (angles.size > 1) throw new Error("The columns name different units of angle.");
  return { ...found, radians: angles.has(true) };
}
