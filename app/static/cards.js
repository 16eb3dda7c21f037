// The list of solutions: a card each with picture, largest errors and verdict; usable ones first, grouped by kind.

import { button, definitions, element, signed, text, thumbnail } from "./drawing.js";
import { fitOf, roundedText, worstRows } from "./fit.js";
import { itemOf, placesOf, unitOf } from "./motion.js";
import { RAD } from "./plane.js";
import { build, capital } from "./shell.js";
import { mark } from "./verdict.js";

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
  rank: (solution) => solution.rank ?? 0,
  error: (solution) => solution.errors.objective,
  transmission: (solution) => -solution.transmission_angle_min,
  size: (solution) => solution.size ?? longest(solution),
};

const unusable = ({ verdict }) => mark(verdict)?.kind === "bad";

/** Sort solutions: usable ones first, then by "rank", "error", "transmission" (largest first) or "size" (smallest). */
export const sorted = (solutions, by) =>
  solutions.toSorted((a, b) => unusable(a) - unusable(b) || SORTS[by](a) - SORTS[by](b));

/** Rows [plural name of a kind, its solutions], in the order in which the kinds first come. */
export function grouped(solutions) {
  const groups = new Map();
  for (const solution of solutions) {
    const name = solution.links
      ? "Four-bars"
      : capital(PLURALS[solution.kind] ?? KINDS[solution.kind] ?? solution.kind);
    groups.set(name, [...(groups.get(name) ?? []), solution]);
  }
  return [...groups];
}

const SOURCES = { hand: "By hand:", moved: "Moved:", link: "From the link:" };

/** Return the name of a solution on its card. */
export const nameOf = ({ rank, source, family, kind, driver, links }) =>
  `${SOURCES[source] ?? `${rank}.`} ${links ? family.replace("_", "-") : `${KINDS[kind] ?? kind}, ${driver}`}`;

/** The sign of a verdict on a motion with its words. */
export function sign(verdict, motion) {
  const found = mark(verdict, itemOf(motion));
  return found
    ? signed("span", `verdict ${found.kind}`, found.sign, found.text)
    : signed("span", "verdict", "·", "errors computed by this page; the service has not checked it");
}

/** Make the card of a solution as a list item; `choose()` is called when it is pressed, `compare(on)` to compare it. */
export function card(solution, motion, size, pinned, choose, compare) {
  const fit = fitOf(solution, motion),
    { sense, low, high } = fit.pass,
    unit = unitOf(motion),
    name = nameOf(solution),
    rounded = roundedText(solution, size, ` ${unit}`),
    rows = solution.off ? [["error", solution.off, null]] : worstRows(fit, motion, size),
    worst = rows.map(([term, error, k]) => [term, k === null ? error : `${error} (${k})`]);
  const facts = [
    ...worst,
    rounded && solution.rounded.closes && ["rounded", rounded],
    ["transmission", `${text(solution.transmission_angle_min, 3)}°`],
    [solution.links ? "longest link" : "longest guide", `${text(longest(solution), 4)} ${unit}`],
    Number.isFinite(solution.size) && ["size", `${text(solution.size, 3)} × motion`],
  ];
  const words = name + (solution.has_smallest_error ? " · smallest error" : "") + (solution.better ? " · better" : ""),
    cardButton = button("", choose, unusable(solution) ? "broken" : ""),
    box = {
      type: "checkbox",
      checked: pinned,
      "aria-label": `Compare ${name}`,
      onchange: ({ target }) => compare(target.checked),
    },
    pin = build("input", box);
  cardButton.append(
    thumbnail(fit.linkage, [sense * low * RAD, sense * high * RAD], placesOf(motion)),
    element("span", "name", words),
    definitions(facts.filter(Boolean)),
    sign(solution.verdict, motion),
  );
  return element("li", "", cardButton, element("label", "check", pin, " Compare"));
}
