// The sheet that is printed: canvas, dimensions and errors on one page; layers and the list of parts on a second one.

import { nameOf } from "./cards.js";
import { element, make, tableOf, text } from "./drawing.js";
import { fitOf, settled } from "./fit.js";
import { itemOf, unitOf, wantsAngles } from "./motion.js";
import { numberRows } from "./numbers.js";
import { $, listed } from "./shell.js";
import { drawStack } from "./stack.js";
import { mark, reasons } from "./verdict.js";

const DIGITS = 6;
const LEFT_OUT = /error|^(Size|Detour|Ground angle|Body offset)/; // errors are in the table of poses

/** The canvas as it is shown, for the eye alone. */
function drawing() {
  const svg = $("canvas").cloneNode(true);
  svg.removeAttribute("id");
  for (const part of svg.querySelectorAll("[tabindex]")) part.removeAttribute("tabindex");
  svg.setAttribute("class", "sheet-drawing");
  return svg;
}

const number = (value, digits = DIGITS) => (value === null || value === undefined ? "" : text(value, digits));

/** Names of the columns of the list of parts. */
const PARTS = { name: "part", mass: "mass, g" };
const COLUMNS = ["name", "material", "length", "thickness", "diameter", "holes", "tolerance", "mass"];

/** The stack from the side, and the list of its parts in millimetres. */
function partsOf(assembly, parts) {
  const stack = make("svg", { class: "pile" });
  drawStack(stack, assembly);
  const columns = COLUMNS.filter((name) => parts.some((part) => part[name])),
    cell = (value) => (value && !Number.isNaN(Number(value)) ? number(Number(value), 5) : value),
    rows = parts.map((part) => columns.map((name) => cell(part[name])));
  const names = columns.map((name) => PARTS[name] ?? name);
  return element(
    "section",
    "parts",
    element("h3", "", "Layers from the side; parts in mm"),
    stack,
    tableOf(names, rows),
  );
}

/** Fills the sheet with a solution, its drive and the list of its parts; without one the page prints as it is. */
export function fillSheet(answer, solution, drive, parts = null) {
  const sheet = $("sheet");
  sheet.replaceChildren();
  document.body.classList.toggle("has-sheet", Boolean(solution));
  if (!solution) return;
  const { motion, request, size } = answer,
    { pass, places, turns, worst } = fitOf(solution, motion),
    unit = unitOf(motion),
    item = itemOf(motion),
    verdict = mark(solution.verdict, item),
    judged = verdict ? `${verdict.sign} ${verdict.text}.` : "Not checked by the service.";
  const title = solution.links ? "Four-bar linkage" : nameOf(solution).replace(/^\S+ /, ""),
    units = `Lengths in ${unit}, angles in degrees, counter-clockwise. ${judged}`,
    why = solution.verdict ? reasons(solution.verdict, item) : [],
    box = request.limits?.pivot_box;
  const rows = [
    ...numberRows(solution, answer, DIGITS).filter(([name]) => !LEFT_OUT.test(name)),
    ...why.map((reason) => ["", reason]),
    ...(box ? [["pivot box", box.map((value) => number(value)).join(", ")]] : []),
  ];
  const poses = motion.poses.map((pose, k) => [
    k + 1,
    number(settled(pass.angles[k], pass.high - pass.low), 5),
    number(pose.x),
    number(pose.y),
    wantsAngles(motion) ? number(pose.angle) : "",
    number(places[k] && settled(places[k], size), 3),
    number(turns[k] && settled(turns[k], 57), 3),
    listed(k === worst.place && "worst place", k === worst.turn && "worst angle"),
  ]);
  const crank = pass.turns ? "crank°" : `${solution.driver}, ${unit}`,
    driven = drive?.rows() ?? [];
  sheet.append(
    element("header", "", element("h2", "", title), element("p", "", units)),
    drawing(),
    element(
      "div",
      motion.poses.length > 30 ? "sheet-columns long" : "sheet-columns",
      tableOf(["Dimension", ""], rows),
      tableOf([item, crank, "x", "y", "angle°", `off, ${unit}`, "off, °", ""], poses),
      driven.length && tableOf(["Drive", ""], driven),
    ),
  );
  if (parts && solution.verdict?.assembly) sheet.append(partsOf(solution.verdict.assembly, parts));
}
