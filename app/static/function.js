// The form of a function: a law chosen, drawn or typed, which is the law of the motion in the editor.

import { make, pathData, put } from "./drawing.js";
import { DRIVES, PAD, SIZES, SPECIAL, isTable, lawFields, pairs, rowsOf } from "./law.js";
import { $, listen } from "./shell.js";

/** Ends of x with which a function begins; others begin with 1 and 2. */
const ENDS = { sin: ["0", "90"], cos: ["0", "90"], tan: ["0", "45"] };
const endsOf = (name) => ENDS[name] ?? ["1", "2"];
const FEW_ROWS = 5; // number of free dimensions of a four-bar, which can meet that many rows exactly

function tracePad(points) {
  put($("pad").querySelector(".pen"), { d: points.length > 1 ? pathData(points) : "" });
}

function startPad(save) {
  const pad = $("pad"),
    { width, height, border } = PAD;
  let points = [];
  make("rect", { class: "frame", x: 0.5, y: 0.5, width: width - 1, height: height - 1 }, pad);
  make("path", { class: "pen" }, pad);
  const pointOf = (event) => {
    const box = pad.getBoundingClientRect(),
      clip = (share, extent) => Math.min(Math.max(share * extent, border), extent - border),
      [x, y] = [event.clientX - box.left, event.clientY - box.top];
    return [clip(x / box.width, width), clip(y / box.height, height)];
  };
  pad.addEventListener("pointerdown", (event) => {
    pad.setPointerCapture(event.pointerId);
    points = [pointOf(event)];
    tracePad(points);
  });
  pad.addEventListener("pointermove", (event) => {
    if (!pad.hasPointerCapture(event.pointerId)) return;
    const point = pointOf(event);
    if (point[0] > points.at(-1)[0] + 0.5) points.push(point); // a function has one y for each x
    tracePad(points);
  });
  pad.addEventListener("pointerup", () => save(points));
  listen("pad-clear", "click", () => save([]));
}

/** The rows of the table of a law; nothing if it has none that can be used, which is said when it is solved. */
function columnsOf(law) {
  try {
    return isTable(law) ? rowsOf(law) : {};
  } catch {
    return {};
  }
}

const ASSUMED =
  "The largest error anywhere counts the curve between the rows too, which is assumed to be smooth. " +
  "To meet these rows only, choose root mean square error.";

/** Sentences on how the table of a law was read. */
function tableNote(law, { output }) {
  const assumed = law.name === "pairs" && output?.length <= FEW_ROWS && law.objective === "max";
  return assumed ? `${pairs.notes} ${ASSUMED}`.trim() : pairs.notes;
}

/** Shows the fields that a law needs. */
function showNeeded(law, columns) {
  const { name, drive } = law,
    special = SPECIAL.includes(name);
  const kinds = {
    name: !["drawn", "table", "pairs", ...SPECIAL].includes(name),
    crank: !special && !(name === "pairs" && columns.input),
    rocker: !special && name !== "pairs",
    curve: name !== "quick",
    [name]: true,
  };
  for (const block of document.querySelectorAll("[data-for]"))
    block.hidden = !block.dataset.for.split(" ").some((kind) => kinds[kind]);
  for (const field of document.querySelectorAll("[data-drive]"))
    field.hidden = !field.dataset.drive.split(" ").includes(drive);
  const { asks, says } = DRIVES[drive];
  for (const [k, end] of ["input", "output"].entries()) {
    $(`${end}-label`).textContent = says[k];
    $(`${end}-unit`).textContent = asks[`${end}_unit`] ? "length" : "°";
  }
  [$("stroke-label").textContent, $("stroke-unit").textContent] = (SIZES[drive] ?? SIZES.four_bar).says;
}

/** Binds the form; `edit(change, kind)` changes the motion, `settle()` ends a step. Returns what shows a motion. */
export function startFunction(edit, settle) {
  for (const field of lawFields()) {
    const { id } = field,
      isCheck = field.type === "checkbox";
    const change = ({ law }) => {
      const before = law.name,
        isUsual = (end, k) => law[end] === endsOf(before)[k];
      law[id] = isCheck ? field.checked : field.value;
      if (id === "name" && ["x0", "x1"].every(isUsual)) [law.x0, law.x1] = endsOf(law.name);
    };
    listen(id, isCheck || field.matches("select") ? "change" : "input", () => edit(change, `law ${id}`));
    listen(id, "blur", settle);
  }
  startPad((points) => edit(({ law }) => (law.drawn = points)));
  return ({ law }) => {
    document.body.dataset.kind = law ? "function" : "motion";
    // a four-bar for a function has no body point
    const [onBody] = $("drive-on").options;
    onBody.disabled = law?.drive === "four_bar";
    if (onBody.disabled && onBody.selected) $("drive-on").value = "rocker";
    if (!law) return;
    if (isTable(law)) pairs.read(law.table);
    // the names of its columns say what a table holds
    const columns = columnsOf(law);
    if (columns.x) law.name = "table";
    if (columns.output) law.name = "pairs";
    for (const field of lawFields())
      if (field.type === "checkbox") field.checked = law[field.id];
      else if (field !== document.activeElement || field.matches("select")) field.value = law[field.id];
    tracePad(law.drawn);
    showNeeded(law, columns);
    $("table-note").textContent = isTable(law) ? tableNote(law, columns) : "";
  };
}
