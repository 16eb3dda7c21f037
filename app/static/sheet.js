// The sheet that is printed: poses, dimensions and errors on one page; layers and the list of parts on a second one.

import { nameOf } from "./cards.js";
import { LinkageShape, View, element, make, pathData, pointPath, tableOf, text } from "./drawing.js";
import { fitOf, settled } from "./fit.js";
import { itemOf, placeOf, unitOf, wantsAngles, wantsPlaces } from "./motion.js";
import { numberRows } from "./numbers.js";
import { RAD } from "./plane.js";
import { $, listed } from "./shell.js";
import { drawStack } from "./stack.js";
import { driveName } from "./timing.js";
import { mark, reasons } from "./verdict.js";

const SIZE = [720, 400];
const CHART = [720, 120];
const MOST_GHOSTS = 24;
const DIGITS = 6;
const LEFT_OUT = /error|^(Size|Detour|Ground angle|Body offset)/; // errors are in the table of poses

const picture = (size) => make("svg", { viewBox: `0 0 ${size.join(" ")}`, class: "sheet-drawing" });
/** The joints of a linkage at even steps over the interval that it uses. */
const joints = ({ linkage, pass: { sense, low, high } }) => linkage.over(sense * low * RAD, sense * high * RAD, 180);

function drawing(fit, motion, drive) {
  const svg = picture(SIZE),
    view = new View(...SIZE),
    used = joints(fit).filter(Boolean);
  const targets = wantsPlaces(motion) ? motion.poses.map(placeOf) : [];
  if (!used.length) return svg;
  const parts = drive?.lines() ?? [];
  view.fit([used[0].a, used[0].b, ...used.flatMap((j) => [j.c, j.d, j.p]), ...targets, ...parts.flat()], 26);
  fit.at.forEach((j, k) => {
    if (j && k % Math.ceil(fit.at.length / MOST_GHOSTS) === 0)
      make("path", { class: "ghost", d: `${pathData([j.d, j.c, j.p].filter(Boolean), view)}Z` }, svg);
  });
  make("path", { class: "curve", d: pointPath(used, view) }, svg);
  new LinkageShape(svg).show(fit.at[0] ?? used[0], view);
  for (const line of parts) {
    make("path", { class: "drive-rod", d: pathData(line, view) }, svg);
    for (const joint of line)
      make("circle", { class: "drive-joint", cx: view.x(joint[0]), cy: view.y(joint[1]), r: 3.5 }, svg);
  }
  targets.forEach((target, k) => {
    if (!target) return;
    const [x, y] = view.at(target),
      { angle } = motion.poses[k],
      arm = angle === null ? "" : `l${14 * Math.cos(angle * RAD)} ${-14 * Math.sin(angle * RAD)}`;
    make("circle", { class: "wanted", cx: x, cy: y, r: 3 }, svg);
    if (wantsAngles(motion) && arm) make("path", { class: "wanted", d: `M${x} ${y}${arm}` }, svg);
    make("text", { class: "wanted", x: x - 5, y: y - 7, text: String(k + 1) }, svg);
  });
  return svg;
}

/** The transmission angle over the whole used interval. */
function transmission(fit) {
  const svg = picture(CHART),
    { sense, low, high, turns } = fit.pass,
    [left, right, top, bottom] = [34, CHART[0] - 12, 8, CHART[1] - 20],
    x = (share) => left + share * (right - left),
    y = (angle) => bottom - (angle / 90) * (bottom - top);
  for (const angle of [0, 30, 60, 90]) {
    make("path", { class: "rule", d: `M${left} ${y(angle)}H${right}` }, svg);
    make("text", { class: "tick", x: left - 5, y: y(angle) + 4, "text-anchor": "end", text: `${angle}°` }, svg);
  }
  for (const share of [0, 0.25, 0.5, 0.75, 1]) {
    const words = `${text(sense * (low + share * (high - low)), 4)}${turns ? "°" : ""}`,
      anchor = share === 1 ? "end" : "middle";
    make("text", { class: "tick", x: x(share), y: CHART[1] - 5, "text-anchor": anchor, text: words }, svg);
  }
  const used = joints(fit),
    curve = used.map((j, k) => j && [x(k / (used.length - 1)), y(j.transmission / RAD)]);
  make("path", { class: "curve", d: pathData(curve) }, svg);
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
    { pass, places, turns, worst, ...fit } = fitOf(solution, motion),
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
    drawing({ pass, ...fit }, motion, drive),
    element(
      "div",
      motion.poses.length > 30 ? "sheet-columns long" : "sheet-columns",
      tableOf(["Dimension", ""], rows),
      tableOf([item, crank, "x", "y", "angle°", `off, ${unit}`, "off, °", ""], poses),
      driven.length && tableOf(["Drive", ""], driven),
    ),
    element("h3", "", `Transmission angle over the ${driveName(solution)} from ${item} 1`),
    transmission({ pass, ...fit }),
  );
  if (parts && solution.verdict?.assembly) sheet.append(partsOf(solution.verdict.assembly, parts));
}
