// The numbers of a solution: its dimensions, errors, verdict and crank angles, as rows and as blocks of the page.

import { button, definitions, element, namedRows, signed, text } from "./drawing.js";
import { LINKS, errorText, fitOf, guideRows, roundedLinks, roundedText, settled } from "./fit.js";
import { lawRows } from "./law.js";
import { itemOf, unitOf } from "./motion.js";
import { build, capital } from "./shell.js";
import { studyRows } from "./studies.js";
import { driveName, drivePlaces, driveTurns, passing } from "./timing.js";
import { judged, limitName, reasons } from "./verdict.js";

const DIGITS = 4; // of numbers that are shown; their titles and copies have more
const ILL_POSED =
  "Clearly different linkages make this motion about equally well: the motion does not determine the link lengths.";
const BY_HAND = "Changed by hand: this page computes its errors, and there is no verdict.";
const FROM_THERE = " The service can refine it to the nearest optimum from this position.";

/** Rows [name, value] of a solution, its lengths and angles with `digits` digits. */
export function numberRows(solution, { motion, size }, digits = DIGITS) {
  const { links, mount, rounded, errors, transmission_angle_min_turn: fullTurnAngle } = solution,
    unit = unitOf(motion),
    item = itemOf(motion),
    { places, turns, worst } = fitOf(solution, motion);
  const number = (value) => text(value, digits),
    coordinate = (value) => number(settled(value, size)),
    length = (value) => `${coordinate(value)} ${unit}`,
    point = (pair) => `${pair.map(coordinate).join(", ")} ${unit}`,
    degrees = (value) => `${number(value)}°`;
  const at = (k, error) => (error === "rounding" ? error : `${error} at ${item} ${k + 1}`),
    turnError = (value) => errorText(value, 57, "°"),
    placeError = (value) => errorText(value, size, ` ${unit}`),
    angle = (value) => `${text(value, DIGITS)}°`;
  const start = driveTurns(solution) ? degrees : length,
    polar = mount?.coupler_point_polar,
    activeLimits = solution.determination?.active_limits ?? [],
    off = roundedText(solution, size, ` ${unit}`),
    lengths =
      off && rounded.closes && roundedLinks(rounded).map(([name, linkLength]) => `${name} ${number(linkLength)}`);
  const rows = [
    ...(links
      ? LINKS.map((name) => [capital(name), length(links[name])])
      : guideRows(solution, number, coordinate, length)),
    ["Branch", solution.branch > 0 ? "+1" : "−1"],
    links ? ["Start angle", degrees(solution.start_angle)] : [`Drive at the first ${item}`, start(solution.start)],
    Number.isFinite(solution.body_offset) && ["Body offset", degrees(solution.body_offset)],
    mount && ["Pivot A", point(mount.pivot_a)],
    mount && ["Pivot B", point(mount.pivot_b)],
    mount && ["Ground angle", degrees(settled(mount.ground_angle, 57))],
    polar && ["Coupler point", `${length(polar.radius)} at ${degrees(settled(polar.angle, 57))}`],
    worst.turn !== null && ["Angle error, largest", at(worst.turn, turnError(Math.abs(turns[worst.turn])))],
    worst.place !== null && ["Position error, largest", at(worst.place, placeError(places[worst.place]))],
    ...(solution.output ? lawRows(solution, unit) : []),
    errors.rotation_rms !== null && ["Angle error, rms", turnError(errors.rotation_rms)],
    errors.position_rms !== null && ["Position error, rms", placeError(errors.position_rms)],
    Number.isFinite(solution.size) && ["Size", `${number(solution.size)} × motion`],
    Number.isFinite(solution.excursion) && [`Detour between ${item}s`, `${text(solution.excursion, 3)} × distance`],
    ["Transmission", angle(solution.transmission_angle_min)],
    Number.isFinite(solution.arm_min) && ["Moment arm, smallest", length(solution.arm_min)],
    Number.isFinite(fullTurnAngle) && ["Transmission, whole turn", angle(fullTurnAngle)],
    activeLimits.length && ["Limited by", activeLimits.map(limitName).join(", ")],
    lengths && ["Rounded links", `${lengths.join(", ")} ${unit}`],
    off && ["Error when rounded", off],
  ];
  return [...rows.filter(Boolean), ...studyRows(solution, unit)];
}

/** Return the drive positions at the samples with their unit; null if the request gives them. */
export function placesInWords(solution, motion, digits = DIGITS) {
  const sign = driveTurns(solution) ? "°" : ` ${motion.unit}`;
  return drivePlaces(solution)?.map((position) => `${text(position, digits)}${sign}`) ?? null;
}

function verdictBlock(solution, motion) {
  const { verdict } = solution,
    item = itemOf(motion),
    rows = judged(verdict, motion, item, driveName(solution)),
    sentences = reasons(verdict, item);
  const judgement = ([name, good, words]) => {
    const kind = good ? "good" : ["Practical limits", "Limits", "Tolerance", "Layers"].includes(name) ? "poor" : "bad";
    return [name, signed("dd", kind, { good: "✓", poor: "!", bad: "✕" }[kind], words)];
  };
  const list = definitions(rows.map(judgement)),
    why = sentences.map((sentence) => element("li", "", sentence));
  return element("div", "judged", element("h3", "", "Verdict"), list, why.length > 0 && build("ul", {}, why));
}

/** The crank angles that a solution brings along, in the order in which the samples are passed. */
function crankBlock(solution, motion) {
  const item = itemOf(motion),
    words = placesInWords(solution, motion),
    { order } = passing(solution, motion, false),
    table = namedRows(order.map((k) => [`${capital(item)} ${k + 1}`, words[k]]));
  const title = driveTurns(solution) ? "Crank angles" : `Travel of the ${solution.driver}`;
  return build("details", {}, element("summary", "", `${title} at the ${item}s`), table);
}

/** Return the action for a linkage that was changed by hand. */
function handBlock({ links }) {
  const refine = () => document.dispatchEvent(new Event("refinehere")),
    sentence = element("p", "note", BY_HAND + (links ? FROM_THERE : ""));
  return element("div", "judged", sentence, links && button("Refine from there", refine, "", { id: "refine-here" }));
}

/** Return the elements that describe a solution of an answer. */
export function numberBlocks(solution, answer) {
  const { motion } = answer,
    table = namedRows(numberRows(solution, answer));
  numberRows(solution, answer, 8).forEach(([, value], k) => (table.rows[k].cells[1].title = value));
  return [
    solution.verdict ? verdictBlock(solution, motion) : solution.source === "hand" && handBlock(solution),
    table,
    drivePlaces(solution) && !solution.output && crankBlock(solution, motion),
    solution.determination?.ill_posed && element("p", "note", ILL_POSED),
  ].filter(Boolean);
}
