// Sentences on an answer: how near its best linkage comes, what holds it, and what its notes say and offer to change.

import { button } from "./drawing.js";
import { fitOf, roundedText, worstRows, worstWords } from "./fit.js";
import { itemOf } from "./motion.js";
import { preferred } from "./service.js";
import { $ } from "./shell.js";
import { defects, limitName, plainNote } from "./verdict.js";

const FIRST = {
  balanced: "the best balance of size, transmission angle and swing found",
  size: "the smallest found",
  transmission: "the best transmission angle found",
  crank_span: "the shortest swing found",
  layers: "the simplest layers found",
};
const ENDED = "No linkage was found within these limits, and the search ran to its end.";
const LOOSEN = "Loosen a limit, allow any family, or let the pivots lie elsewhere.";

/** Return true if a note belongs beside the smallest error: no linkage is near, or another order is much nearer. */
const matters = (note) => note.startsWith("No linkage that was found comes near") || note.endsWith("(`order`).");

/** Return the errors of the best linkage in a few words: "off by 0.27 mm (pose 5) and 0.08° (pose 4)". */
export function howNear({ reply, motion }) {
  const best = reply.solutions[0];
  if (best.off) return best.off === "rounding" ? "met to within rounding" : `off by at most ${best.off}`;
  const rows = worstRows(fitOf(best, motion), motion, reply.report.length_scale ?? 1),
    off = rows.filter(([, , pose]) => pose !== null);
  if (!off.length) return "met to within rounding";
  return `off by ${worstWords(off, motion)}`;
}

/** The status line of an answer of which a solution is selected. */
export function sentenceOf({ reply, request, motion, stored, live, seconds }, selected) {
  const { status, solutions, report } = reply,
    item = itemOf(motion),
    plain = (notes) => notes.map((remark) => plainNote(remark, item)),
    nearness = (solution) => howNear({ reply: { solutions: [solution], report }, motion }),
    time = `${seconds?.toFixed(1)} s`;
  const [best] = solutions;
  if (!best) {
    const why = plain(report.notes.filter((remark) => !remark.startsWith("No linkage within"))).join(" "),
      proved = status === "infeasible" ? ENDED : `None was found in ${time}; this does not prove that there is none.`;
    return `${proved} ${why || LOOSEN}`;
  }
  if (live) {
    const source = selected.source === "moved" ? "Moved with the motion" : "Found beside the one that was moved",
      better = solutions.some((solution) => solution.better) && !selected.better;
    return `${source}: ${nearness(selected)}.${better ? " A better linkage was found; see the cards." : ""}`;
  }
  const reached = status === "reached",
    activeLimits = best.determination?.active_limits ?? [],
    limits = new Intl.ListFormat("en-GB").format(activeLimits.map(limitName)),
    limited = activeLimits.length && !reached ? `, limited by ${limits}` : "",
    within = reached && request.tolerances && `Within the allowed errors at every ${item}`,
    summary = within || (!request.tolerances && request.prefer && "Near the smallest error"),
    first = FIRST[preferred(request)],
    rounded = roundedText(best, report.length_scale, ` ${motion.unit}`);
  const parts = [
    `${summary && first ? `${summary}, ${first}` : summary || "Best found"}: ${nearness(best)}${limited}.`,
    rounded && `With rounded links: ${rounded}.`,
    report.stopped_by === "budget" && !stored && `The time was up after ${time}; there may be better linkages.`,
    stored && "Searched beforehand.",
    ...plain(report.notes.filter(matters)),
    request.tolerances && !reached && `The errors exceed the tolerances at some ${item}s.`,
    defects(best.verdict).length && "But none of them is free of defects; see the verdicts.",
  ];
  return parts.filter(Boolean).join(" ");
}

/**
 * [words, request] of a button for what a note offers, or null; the names in its parentheses say which field of the
 * request it is about. `found`: whether there are solutions.
 */
function offered(note, request, found) {
  const [, fields = ""] = /\(([^()]*)\)\.$/.exec(note) ?? [],
    [, name] = /^`limits\.(\w+)`$/.exec(fields) ?? [];
  if (fields === "`order`") return ["Pass them in any order", { ...request, order: "any" }];
  if (name === "family") return ["Allow any family", { ...request, limits: { ...request.limits, family: "any" } }];
  if (found || !name) return null;
  const [, clause] = /; with ([^;]*) there is one /.exec(note) ?? [],
    [value] = /\[.*\]|-?\d[\d.]*(?:e[-+]?\d+)?/.exec(clause ?? "") ?? [];
  if (value)
    return [
      `Set ${limitName(name)} to ${value}${clause.includes(" degrees") ? "°" : ""}`,
      { ...request, limits: { ...request.limits, [name]: JSON.parse(value) } },
    ];
  const { [name]: dropped, ...limits } = request.limits ?? {};
  return dropped === undefined ? null : [`Drop ${limitName(name)}`, { ...request, limits }];
}

/** Offers what the notes of an answer suggest, as buttons that call `use` with another request. */
export function showOffers({ reply: { report, solutions }, request }, use) {
  const all = report.notes.map((remark) => offered(remark, request, solutions.length > 0)).filter(Boolean);
  const found = all.filter(([words], k) => all.findIndex(([label]) => label === words) === k);
  $("suggestions").hidden = !found.length;
  $("suggestions").replaceChildren(...found.map(([words, eased]) => button(words, () => use(eased))));
}
