// The verdict of a solution in words: a mark for the list, and what was judged, with all reasons, for the details.

import { capital } from "./shell.js";

/** How the note begins that four-bars without a crank may come nearer. */
export const SWINGS = "cranks were looked for";

const DEFECTS = ["order", "branch", "circuit"];
const LIMITS = {
  transmission_angle_min: "the transmission angle in use", transmission_angle_min_turn: "the transmission angle over the turn",
  link_min: "links at least", link_max: "links at most", link_ratio_max: "the ratio of the links", links: "given lengths",
  pivot_a: "given pivot A", pivot_b: "given pivot B", pivot_box: "the pivot box", pivot_a_box: "the box of pivot A", pivot_b_box: "the box of pivot B",
  keep_out: "places kept free of pivots", coupler_radius_max: "the reach of the body point", envelope: "the envelope", family: "the family",
  pivot_reach: "the distance of the pivots", body_reach: "the distance of the body point from its joints", crank_span_max: "the crank's turn", lengths_from: "stock lengths",
};

/** The name of a limit of the service in sentences. */
export const limitName = (name) => LIMITS[name] ?? name.replace("links.", "given ").replaceAll("_", " ");

/** A number of layers in words. */
export const layersOf = (count) => `${count} layer${count === 1 ? "" : "s"}`;

/** A reason as a sentence of its own, in which a sample is called what the page calls it: an `item`. */
const sentence = (reason, item = "sample") => {
  const short = reason.replaceAll(/(\d) degrees/g, "$1°").replaceAll(/\bsample/g, item);
  return `${capital(short)}${/[.!?]$/.test(short) ? "" : "."}`;
};

/** A reason as short as a card has room for. */
const brief = (reason, item) => sentence(reason, item).replace(/\.$/, "").replace(/^The body point goes (\S+) times as far (between two \w+) .*/, "goes $1 times the way $2");

/** The names of what keeps a linkage from making its motion as a machine: "order", "branch", "circuit". */
export const defects = (verdict) => DEFECTS.filter((name) => verdict && verdict[name] === false);

/** Whether a linkage satisfies the practical limits; earlier drafts have no such field. */
const practical = ({ practical: kept, buildable }) => kept ?? buildable;

/** {kind, sign, text}: what the list says of a solution; null without a verdict. */
export function mark(verdict, item) {
  if (!verdict) return null;
  const { reasons = [] } = verdict, wrong = defects(verdict);
  if (wrong.length) return { kind: "bad", sign: "✕", text: `${wrong.join(" and ")} defect${wrong.length > 1 ? "s" : ""}` };
  if (!reasons.length && practical(verdict) && verdict.within_tolerance !== false) {
    const kept = verdict.assembly ? `buildable in ${layersOf(verdict.assembly.count)}` : "within practical limits";
    return { kind: "good", sign: "✓", text: !verdict.within_tolerance ? kept : verdict.assembly ? `${kept}, within tolerance` : `${kept} and tolerance` };
  }
  const more = reasons.length > 1 ? ` (and ${reasons.length - 1} more)` : "";
  const first = reasons.length ? brief(reasons[0], item) : practical(verdict) ? "outside the tolerance" : "outside practical limits";
  return { kind: practical(verdict) ? "poor" : "bad", sign: "!", text: first[0].toLowerCase() + first.slice(1) + more };
}

/** Rows [what was judged, true | false | null, in words] for a solution of a motion. */
export function judged(verdict, motion, item, drive = "crank", turns = true) {
  const free = motion.timing === "free", near = (verdict.reasons ?? []).some((one) => one.includes("near a change point"));
  const passes = !free ? `the ${drive} passes the ${item}s at the ${turns ? "angles" : "places"} given` : `a ${drive} that ${turns ? "turns" : "moves"} one way passes ${motion.anyOrder ? `all ${item}s` : `the ${item}s in the order given`}`;
  const rows = [
    ["Order", verdict.order, verdict.order ? passes : passes.replace("passes", "does not pass")],
    ["Branch", verdict.branch, verdict.branch ? `all ${item}s lie on one branch` : `${item}s lie on different branches: a dead position comes between`],
    ["Circuit", verdict.circuit, verdict.circuit ? `all ${item}s, and all between, lie on one circuit${near ? ", but near a change point" : ""}` : `${item}s lie on different circuits: it would have to be taken apart`],
  ];
  if (verdict.within_tolerance !== null) rows.push(["Tolerance", verdict.within_tolerance, verdict.within_tolerance ? `every ${item} keeps it` : `not every ${item} keeps it`]);
  if (verdict.assembly) rows.push(["Layers", verdict.assembly.status === "free", verdict.assembly.status === "free" ? `nothing collides in ${verdict.assembly.count}` : "parts collide in all"]);
  rows.push(["Practical limits", practical(verdict), practical(verdict) ? "all are kept" : "one or more are broken"]);
  return rows;
}

export const reasons = (verdict, item) => (verdict.reasons ?? []).map((one) => sentence(one, item));

/** Words of the service, with the page's names of its fields. */
export const plainWords = (words) => words.replace("limits links ", "given ").replace("`nevertheless` in `solids`", "“even where parts collide”").replaceAll(/`?(?:limits[. ])?\b(?<!constraints )([a-z]+_\w+)`?/gi, (all, name) => LIMITS[name.toLowerCase()] ?? all).replaceAll("`", "");

/** A note of a report in the page's words, as a sentence. */
export function plainNote(note, item) {
  if (note.startsWith("the problem is ill-posed")) return "Clearly different linkages do about equally well.";
  if (note.startsWith("the crank angles are given")) return "With given crank angles the practical limits hold only where they are switched on under Limits.";
  if (note.startsWith(SWINGS)) return "Four-bars that only swing may come nearer: any family, under Limits.";
  return sentence(plainWords(note).replace(/^\w+(?= excludes )/, limitName), item);
}
