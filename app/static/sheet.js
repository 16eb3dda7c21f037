// The sheet that is printed: canvas, dimensions and errors on one page; layers and flat parts on a second one.

import { nameOf } from "./cards.js";
import { element, tableOf, text } from "./drawing.js";
import { fitOf, settled } from "./fit.js";
import { itemOf, unitOf, wantsAngles } from "./motion.js";
import { numberRows } from "./numbers.js";
import { $, listed } from "./shell.js";
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

/** Copies of the pictures of layers and flat parts that the page shows. */
function partsOf() {
  const shown = [...document.querySelectorAll("#stack, #parts svg")].filter((svg) => svg.childElementCount),
    copies = shown.map((svg) => svg.cloneNode(true));
  for (const copy of copies) copy.removeAttribute("id");
  return element("section", "parts", element("h3", "", "Layers from the side, and flat parts"), ...copies);
}

/** Fills the sheet with a solution, its drive and perhaps its parts; without a solution the page prints as it is. */
export function fillSheet(answer, solution, drive, withParts) {
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
      driven.length > 0 && tableOf(["Drive", ""], driven),
    ),
  );
  if (withParts) sheet.append(partsOf());
}
