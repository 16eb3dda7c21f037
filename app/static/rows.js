// Numbers typed in lines: which characters separate them, and which mark decimals and thousands.

const cellsOf = (line, separator) => line.split(separator).map((cell) => cell.replace(/^"(.*)"$/, "$1"));

/** What separates cells, and whether decimals are marked by a comma: found from all lines of a file together. */
function readLayout(lines) {
  const all = (character) => lines.some((line) => line.includes(character)),
    layout = (separator) => [separator, marksDecimals(lines.flatMap((line) => cellsOf(line, separator)))];
  if (all(";")) return layout(/\s*;\s*/);
  if (all("\t")) return layout(/ *\t */);
  // "1,5 2,5": blanks separate and commas are decimal where no comma is followed by a blank
  if (
    all(",") &&
    lines.every((line) => !/,\s|,$|^,|,,/.test(line) && (!line.includes(",") || /\S\s+\S/.test(line))) &&
    lines.some((line) => /(^|\s)[-+]?\d+,\d/.test(line))
  )
    return layout(/\s+/);
  return all(",") ? [/\s*,\s*/, false] : [/\s+/, false];
}

/** Whether a comma marks decimals: the last of two different marks does, and one that does not stand before just three digits. */
function marksDecimals(cells) {
  const found = new Set(
    cells.flatMap((cell) => {
      const marks = cell.match(/[.,]/g) ?? [],
        last = marks.at(-1);
      if (!marks.length || new Set(marks).size > 1) return marks.slice(-1);
      if (marks.length > 1) return [last === "," ? "." : ","];
      return /^[-+]?[1-9]\d{0,2}[.,]\d{3}(\D|$)/.test(cell) ? [] : [last];
    }),
  );
  if (found.size > 1) throw new Error("Some numbers have a decimal comma and others a decimal point.");
  return found.size ? found.has(",") : cells.some((cell) => /\d,\d/.test(cell));
}

/** A number as spreadsheets show it (grouped thousands, a minus of its own, a degree sign) in plain characters. */
function plainNumber(cell, decimalComma) {
  const plain = cell
    .replace(/\s*°$/, "")
    .replace("\u2212", "-")
    .replace(/(?<=\d)[\u00a0\u202f\u2009'’](?=\d{3})/g, "")
    .trim();
  const whole = plain.replace(decimalComma ? /(?<=\d)\.(?=\d{3}(\D|$))/g : /(?<=\d),(?=\d{3}(\D|$))/g, "");
  // a mark that is left of those that group stood at no place for one
  return decimalComma ? (whole.includes(".") ? plain : whole.replace(",", ".")) : whole;
}

/** The cells of lines of numbers without names of columns; a separator at the end of a line separates nothing. */
export function readCells(lines) {
  const ended = lines.map((line) => line.trim().replace(/\s*[,;]$/, "")),
    [separator, decimalComma] = readLayout(ended);
  return ended.map((line) => cellsOf(line, separator).map((cell) => plainNumber(cell, decimalComma)));
}
