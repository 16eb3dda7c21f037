// The list of solutions: a card each with picture, largest errors and verdict; sorted as the reader asks.

import { button, element, signed, text, thumbnail } from "./drawing.js";
import { fitOf, roundedText, worstRows } from "./fit.js";
import { itemOf, placesOf, unitOf } from "./motion.js";
import { RAD } from "./plane.js";
import { mark } from "./verdict.js";

const FAMILIES = {
  crank_rocker: "crank-rocker", double_crank: "double-crank", rocker_crank: "rocker-crank",
  double_rocker: "double-rocker", triple_rocker: "triple-rocker", change_point: "change point",
};
const KINDS = { slider_crank: "slider-crank", swinging_block: "swinging block", rail_slot: "rail and slot", two_rails: "two rails", two_slots: "two slots" };
const longest = ({ links, guides }) => Math.max(...(links ? Object.values(links) : guides.map(({ radius, used }) => radius ?? (used ? used[1] - used[0] : 0))));
const SORTS = {
  rank: (one) => one.rank ?? 0,
  error: (one) => one.errors.objective,
  transmission: (one) => -one.transmission_angle_min,
  size: (one) => one.size ?? longest(one),
};

/** Solutions in an order by name: "rank", "error", "transmission" (largest first), "size" (smallest first). */
export const sorted = (solutions, by) => solutions.toSorted((a, b) => SORTS[by](a) - SORTS[by](b));

/** What a card calls a solution. */
export const nameOf = ({ rank, source, family, kind, driver, links }) => `${source === "hand" ? "By hand:" : source === "link" ? "From the link:" : `${rank}.`} ${links ? FAMILIES[family] ?? family : `${KINDS[kind] ?? kind}, ${driver}`}`;

function facts(rows) {
  const list = document.createElement("dl");
  for (const [term, value] of rows) list.append(element("dt", "", term), element("dd", "", value));
  return list;
}

/** The sign of a verdict on a motion with its words. */
export function sign(verdict, motion) {
  const found = mark(verdict, itemOf(motion));
  return found ? signed("span", `verdict ${found.kind}`, found.sign, found.text) : signed("span", "verdict", "·", "errors computed here; the service has not judged it");
}

/** A list item with the card of a solution of a motion; `choose` is called when it is pressed. */
export function card(solution, motion, size, choose) {
  const fit = fitOf(solution, motion), { sense, low, high } = fit.pass, one = button("", choose), item = element("li", "");
  one.append(thumbnail(fit.linkage, [sense * low * RAD, sense * high * RAD], placesOf(motion)));
  const worst = worstRows(fit, motion, size).map(([name, error, pose]) => [name, pose === null ? error : `${error} (${pose})`]);
  const figures = [["transmission", `${text(solution.transmission_angle_min, 3)}°`], [solution.links ? "longest link" : "longest guide", `${text(longest(solution), 4)} ${unitOf(motion)}`]];
  const rounded = roundedText(solution, size, ` ${unitOf(motion)}`);
  if (rounded && solution.rounded.closes) worst.push(["rounded", rounded]);
  if (Number.isFinite(solution.size)) figures.push(["size", `${text(solution.size, 3)} × motion`]);
  one.append(element("span", "name", nameOf(solution) + (solution.has_smallest_error ? " · least error" : "")), facts([...worst, ...figures]), sign(solution.verdict, motion));
  one.classList.toggle("broken", mark(solution.verdict)?.kind === "bad");
  item.append(one);
  return item;
}
