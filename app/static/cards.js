// The list of solutions: a card each with picture, largest errors and verdict; usable ones first, grouped by kind.

import { button, element, signed, text, thumbnail } from "./drawing.js";
import { fitOf, roundedText, worstRows } from "./fit.js";
import { itemOf, placesOf, unitOf } from "./motion.js";
import { RAD } from "./plane.js";
import { capital } from "./shell.js";
import { mark } from "./verdict.js";

const FAMILIES = {
  crank_rocker: "crank-rocker",
  double_crank: "double-crank",
  rocker_crank: "rocker-crank",
  double_rocker: "double-rocker",
  triple_rocker: "triple-rocker",
  change_point: "change point",
};
const KINDS = {
  slider_crank: "slider-crank",
  swinging_block: "swinging block",
  rail_slot: "rail and slot",
  two_rails: "two rails",
  two_slots: "two slots",
};
const PLURALS = { slider_crank: "slider-cranks", swinging_block: "swinging blocks" };
const longest = ({ links, guides }) =>
  Math.max(
    ...(links ? Object.values(links) : guides.map(({ radius, used }) => radius ?? (used ? used[1] - used[0] : 0))),
  );
const SORTS = {
  rank: (one) => one.rank ?? 0,
  error: (one) => one.errors.objective,
  transmission: (one) => -one.transmission_angle_min,
  size: (one) => one.size ?? longest(one),
};

const unusable = ({ verdict }) => mark(verdict)?.kind === "bad";

/** Usable solutions first, then in an order by name: "rank", "error", "transmission" (largest first), "size" (smallest first). */
export const sorted = (solutions, by) =>
  solutions.toSorted((a, b) => unusable(a) - unusable(b) || SORTS[by](a) - SORTS[by](b));

/** Rows [plural name of a kind, its solutions], in the order in which the kinds first come. */
export function grouped(solutions) {
  const groups = new Map();
  for (const one of solutions) {
    const name = one.links ? "Four-bars" : capital(PLURALS[one.kind] ?? KINDS[one.kind] ?? one.kind);
    groups.set(name, [...(groups.get(name) ?? []), one]);
  }
  return [...groups];
}

/** What a card calls a solution. */
export const nameOf = ({ rank, source, family, kind, driver, links }) =>
  `${source === "hand" ? "By hand:" : source === "moved" ? "Moved:" : source === "link" ? "From the link:" : `${rank}.`} ${links ? (FAMILIES[family] ?? family) : `${KINDS[kind] ?? kind}, ${driver}`}`;

function facts(rows) {
  const list = document.createElement("dl");
  for (const [term, value] of rows) list.append(element("dt", "", term), element("dd", "", value));
  return list;
}

/** The sign of a verdict on a motion with its words. */
export function sign(verdict, motion) {
  const found = mark(verdict, itemOf(motion));
  return found
    ? signed("span", `verdict ${found.kind}`, found.sign, found.text)
    : signed("span", "verdict", "·", "errors computed here; the service has not judged it");
}

/** A list item with the card of a solution of a motion: `choose()` when it is pressed, `compare(on)` when it is picked to be compared. */
export function card(solution, motion, size, pinned, choose, compare) {
  const fit = fitOf(solution, motion),
    { sense, low, high } = fit.pass,
    one = button("", choose),
    item = element("li", "");
  one.append(thumbnail(fit.linkage, [sense * low * RAD, sense * high * RAD], placesOf(motion)));
  const worst = worstRows(fit, motion, size).map(([name, error, pose]) => [
    name,
    pose === null ? error : `${error} (${pose})`,
  ]);
  const figures = [
    ["transmission", `${text(solution.transmission_angle_min, 3)}°`],
    [solution.links ? "longest link" : "longest guide", `${text(longest(solution), 4)} ${unitOf(motion)}`],
  ];
  const rounded = roundedText(solution, size, ` ${unitOf(motion)}`);
  if (rounded && solution.rounded.closes) worst.push(["rounded", rounded]);
  if (Number.isFinite(solution.size)) figures.push(["size", `${text(solution.size, 3)} × motion`]);
  one.append(
    element(
      "span",
      "name",
      nameOf(solution) + (solution.has_smallest_error ? " · least error" : "") + (solution.better ? " · better" : ""),
    ),
    facts([...worst, ...figures]),
    sign(solution.verdict, motion),
  );
  one.classList.toggle("broken", unusable(solution));
  const pin = Object.assign(document.createElement("input"), { type: "checkbox", checked: pinned }),
    label = element("label", "check", " Compare");
  pin.setAttribute("aria-label", `Compare ${nameOf(solution)}`);
  pin.addEventListener("change", () => compare(pin.checked));
  label.prepend(pin);
  item.append(one, label);
  return item;
}
