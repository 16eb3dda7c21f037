// The status line: how near the best linkage of an answer comes, what holds it, and what else its notes say.

import { fitOf, roundedText, worstRows, worstWords } from "./fit.js";
import { itemOf } from "./motion.js";
import { matters } from "./offers.js";
import { preferred } from "./service.js";
import { defects, limitName, plainNote } from "./verdict.js";

const FIRST = {
  balanced: "the best balance of size, transmission angle and swing found",
  size: "the smallest found",
  transmission: "the best transmission angle found",
  crank_span: "the shortest swing found",
  layers: "the simplest layers found",
};

/** What the best linkage found really does, in a few words: "off by 0.27 mm (pose 5) and 0.08° (pose 4)". */
export function howNear({ reply, motion }) {
  const best = reply.solutions[0],
    rows = worstRows(fitOf(best, motion), motion, reply.report.length_scale ?? 1),
    off = rows.filter(([, , pose]) => pose !== null);
  if (!off.length) return "met to within rounding";
  return `off by ${worstWords(off, motion)}`;
}

/** The status line of an answer of which a solution is selected. */
export function sentenceOf({ reply: { status, solutions, report }, request, motion, stored, live, seconds }, selected) {
  if (!solutions.length) {
    const why = report.notes
      .filter((one) => !one.startsWith("No linkage within"))
      .map((one) => plainNote(one, itemOf(motion)))
      .join(" ");
    const proved =
      status === "infeasible"
        ? "No linkage was found within these limits, and the search ran to its end."
        : `None found in ${seconds.toFixed(1)} s, when the time was up; that proves nothing.`;
    return [proved, why || "Loosen a limit, allow any family, or let the pivots lie elsewhere.", ""].join(" ").trim();
  }
  if (live) {
    const words = `${selected.source === "moved" ? "Moved with the motion" : "Found beside the one that was moved"}: ${howNear({ reply: { solutions: [selected], report }, motion })}.`;
    return solutions.some(({ better }) => better) && !selected.better
      ? `${words} A better linkage was found: see the cards.`
      : words;
  }
  const held = solutions[0].determination?.active_limits ?? [],
    near = howNear({ reply: { solutions, report }, motion });
  const limited =
    held.length && status !== "reached"
      ? `, limited by ${new Intl.ListFormat("en-GB").format(held.map(limitName))}`
      : "";
  const kept =
      status === "reached" && request.tolerances
        ? `Within the allowed errors at every ${itemOf(motion)}`
        : !request.tolerances && request.prefer && "Near the least error",
    first = FIRST[preferred(request)];
  const parts = [`${kept && first ? `${kept}, ${first}` : kept || "Best found"}: ${near}${limited}.`];
  const rounded = roundedText(solutions[0], report.length_scale, ` ${motion.unit}`);
  if (rounded) parts.push(`With rounded links: ${rounded}.`);
  if (report.stopped_by === "budget" && !stored)
    parts.push(`The time was up after ${seconds.toFixed(1)} s: there may be better ones.`);
  if (stored) parts.push("Searched beforehand.");
  parts.push(...report.notes.filter(matters).map((one) => plainNote(one, itemOf(motion))));
  if (request.tolerances && status !== "reached")
    parts.push(`The allowed errors are not kept at every ${itemOf(motion)}.`);
  if (defects(solutions[0].verdict).length) parts.push("But none is free of defects: see the verdicts.");
  return parts.join(" ");
}
