// Typed numbers, with a decimal comma or point; a browser's own fields of numbers may read 1,5 as 15.

import { text } from "./drawing.js";
import { $, capital } from "./shell.js";

const EITHER = /^([-+−]?[1-9]\d{0,2}),(\d{3})$/; // a thousand or one

/** A typed number, decimal comma or point; null for an empty entry, NaN for what is none or may be two. */
export function typed(entry) {
  const plain = entry.trim();
  return plain === ""
    ? null
    : EITHER.test(plain)
      ? NaN
      : Number(plain.replaceAll("−", "-").replace(/^([-+]?\d*),(\d+)/, "$1.$2"));
}

/** Why an entry is no number. */
export const unreadable = (entry) =>
  EITHER.test(entry.trim())
    ? entry.trim().replace(EITHER, "“$&” may be $1$2 or $1.$2")
    : `“${entry.trim().slice(0, 20)}” is not a number`;

/**
 * The entries of a list of numbers: blanks, semicolons or commas with a blank separate, and other commas mark decimals;
 * without any of these all commas separate. Throws an error if decimals are marked in two ways.
 */
export function listEntries(line) {
  const plain = line.trim(),
    entries = plain.split(/[;\s]/.test(plain) ? /\s*;\s*|,?\s+|,$/ : ",").filter(Boolean);
  if ([/\d,\d/, /\d\.\d/].every((mark) => entries.some((entry) => mark.test(entry))))
    throw new Error("Some numbers have a decimal comma and others a decimal point");
  return entries;
}

/** Rows of numbers that a spreadsheet has copied, of at most `width` cells; null for an empty one. Throws Error. */
export function pastedRows(content, width) {
  const lines = content.replace(/[\r\n]+$/, "").split(/\r\n|\r|\n/),
    room = width === 1 ? "is 1 column" : `are ${width} columns`;
  return lines.map((line, n) => {
    const cells = line.split("\t");
    if (cells.length > width)
      throw new Error(
        `The pasted row ${n + 1} has ${cells.length} cells, but there ${room} from the selected cell on. ` +
          "For a whole table use Paste above.",
      );
    return cells.map((cell, k) => {
      const value = typed(cell.replace(/\s*°$/, ""));
      if (Number.isNaN(value))
        throw new Error(
          `Pasted row ${n + 1}, cell ${k + 1}: ${unreadable(cell)}. For rows with heads use Paste above.`,
        );
      return value;
    });
  });
}

/** Return the fault of a typed value, as a sentence without the name of its field; null if it is valid. */
export function wrong(value, entry, { range: [low, high], needed, whole }) {
  if (value === null) return needed ? "a number is needed" : null;
  if (!Number.isFinite(value)) return unreadable(entry);
  if (whole && !Number.isInteger(value)) return `${text(value)} is not a whole number`;
  if (value >= low && value <= high) return null;
  if (high < 1e50) return `${text(value)} is not from ${text(low)} to ${text(high)}`;
  if (value > high) return `${text(value)} is more than ${text(high)}`;
  return low === Number.MIN_VALUE ? `${text(value)} is not above 0` : `${text(value)} is less than ${text(low)}`;
}

/** The range [low, high] that a field allows by `data-least` and `data-most`. */
export const rangeOf = ({ dataset: { least: minimum, most: maximum } }) => [
  minimum === "above 0" ? Number.MIN_VALUE : Number(minimum ?? -1e50),
  Number(maximum ?? 1e50),
];

/** Marks a field as wrong, for the reason in the element `note`, or takes the mark away. */
export function markWrong(field, isWrong, note) {
  field.classList.toggle("invalid", isWrong);
  for (const [name, value] of [
    ["aria-invalid", "true"],
    ["aria-describedby", note],
  ]) {
    if (isWrong) field.setAttribute(name, value);
    else field.removeAttribute(name);
  }
}

const labelOf = (field) => field.labels[0].textContent.trim().replace(/\s+/g, " ");

/** The number of an entry for a field with `data-number`, null if it is empty. Throws Error with the field's id. */
export function numberOf(field, entry) {
  const value = typed(entry),
    fault = wrong(value, entry, { range: rangeOf(field), needed: field.required });
  if (!fault) return value;
  throw Object.assign(new Error(`${labelOf(field)}: ${fault}.`), { id: field.id });
}

/** The number in a field; the browser says what is wrong with it: in red, and when the form is sent. */
function check(field) {
  const value = typed(field.value),
    isActive = !field.disabled && !field.closest("[hidden]"),
    fault = isActive ? wrong(value, field.value, { range: rangeOf(field), needed: field.required }) : null;
  field.setCustomValidity(fault ? `${capital(fault)}.` : "");
  return fault || Number.isNaN(value) ? null : value;
}

/** The numbers in a field of a list, null if it is empty; `count` are needed, or at least that many. Throws Error. */
export function numbersIn(id, count, isLeast = false) {
  const field = $(id),
    numbers = listEntries(field.value).map(typed);
  if (!numbers.length) return null;
  if (numbers.every(Number.isFinite) && (numbers.length === count || (isLeast && numbers.length > count)))
    return numbers;
  throw new Error(`${labelOf(field)}: ${isLeast ? "at least " : ""}${count} numbers are needed, separated by spaces.`);
}

/** Fields with `data-number` say what is wrong with them from now on. */
export function startNumbers() {
  for (const field of document.querySelectorAll("[data-number]")) {
    field.inputMode = "decimal";
    field.addEventListener("input", () => check(field));
  }
}

/** The number in a field with `data-number`, null if it is empty or hidden. Throws Error if it cannot be used. */
export function numberIn(id) {
  const field = $(id),
    value = check(field);
  if (field.validity.customError) throw new Error(`${labelOf(field)}: ${field.validationMessage}`);
  return value;
}
