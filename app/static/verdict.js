// The verdict of a solution in words: a mark for the list, and what was judged, with all reasons, for the details.

import { capital, counted, spaced } from "./shell.js";

const DEFECTS = ["order", "branch", "circuit"];
const LABELS = {
  family: "the family",
  transmission_angle_min: "the transmission angle in use",
  transmission_angle_min_turn: "the transmission angle over the whole turn",
  pivot_a: "the given pivot A",
  pivot_b: "the given pivot B",
  pivot_box: "the pivot box",
  pivot_a_box: "the box of pivot A",
  pivot_b_box: "the box of pivot B",
  pivot_reach: "the largest distance of the pivots",
  keep_out: "the keep-out boxes",
  link_ratio_max: "the ratio of longest to shortest link",
  link_min: "the smallest link length",
  link_max: "the largest link length",
  links: "the given lengths",
  coupler_radius_max: "the reach of the body point",
  body_reach: "the distance of the body point from its joints",
  envelope: "the envelope",
  stroke_max: "the longest stroke",
  rail_box: "the box of the rails",
  cylinder_dead_length: "the shortest cylinder",
  cylinder_extended_max: "the longest cylinder",
  arm_min: "the smallest moment arm",
  crank_span_max: "the crank's turn",
  lengths_from: "stock lengths",
  ground_box: "the box of the ground point",
  motor_box: "the box of the motor",
};

/** The name of a limit of the service in sentences. */
export const limitName = (name) =>
  name.startsWith("links.") ? `the given ${name.slice(6)} length` : (LABELS[name] ?? spaced(name));

/** A number of layers in words. */
export const layersOf = (count) => counted(count, "layer");

/** A reason as a sentence of its own, in which a sample is called what the page calls it: an `item`. */
const sentence = (reason, item = "sample") => {
  const short = reason.replaceAll(/(\d) degrees/g, "$1°").replaceAll(/\bsample/g, item);
  return `${capital(short)}${/[.!?]$/.test(short) ? "" : "."}`;
};

/** A reason as short as a card has room for. */
const brief = (reason, item) =>
  sentence(reason, item)
    .replace(/\.$/, "")
    .replace(
      /^The body point goes (\S+) times as far (between two \w+) .*/,
      "long detour $2 ($1 times their distance)",
    );

/** The names of what keeps a linkage from making its motion as a machine: "order", "branch", "circuit". */
export const defects = (verdict) => DEFECTS.filter((name) => verdict && verdict[name] === false);

/** Return true if a linkage satisfies the practical limits; earlier drafts lack the field. */
const practical = ({ practical: withCollisions, practical_without_collisions }) =>
  withCollisions ?? practical_without_collisions;

/** {kind, sign, text}: what the list says of a solution; null without a verdict. */
export function mark(verdict, item) {
  if (!verdict) return null;
  const { reasons = [], assembly, within_tolerance: within } = verdict,
    wrong = defects(verdict),
    usable = practical(verdict);
  if (wrong.length)
    return { kind: "bad", sign: "✕", text: `${wrong.join(" and ")} defect${wrong.length > 1 ? "s" : ""}` };
  if (!reasons.length && usable && within !== false) {
    const summary = assembly ? `buildable in ${layersOf(assembly.count)}` : "within practical limits",
      tolerance = assembly ? ", within tolerance" : " and tolerance";
    return { kind: "good", sign: "✓", text: summary + (within ? tolerance : "") };
  }
  const [first = usable ? "outside the tolerance" : "outside practical limits"] = reasons,
    more = reasons.length > 1 ? ` (and ${reasons.length - 1} more)` : "",
    words = reasons.length ? brief(first, item) : first;
  return { kind: usable ? "poor" : "bad", sign: "!", text: words[0].toLowerCase() + words.slice(1) + more };
}

/** Rows [what was judged, true | false | null, in words] for a solution of a motion, whose drive is a `drive`. */
export function judged(verdict, motion, item, drive = "crank") {
  const { order, branch, circuit, within_tolerance: within, assembly } = verdict,
    all = motion.anyOrder ? `all ${item}s` : `the ${item}s in the order given`,
    usable = practical(verdict),
    isPractical = Object.values(motion.limits.kept).some(Boolean);
  const rows = [
    ["Order", order, `the ${drive} passes ${all} in one direction`, `the ${drive} has to turn back to pass ${all}`],
    ["Branch", branch, `all ${item}s lie on one branch`, `a dead position comes between ${item}s`],
    ["Circuit", circuit, `it moves through all ${item}s`, `it has to be disassembled between ${item}s`],
    within !== null && ["Tolerance", within, `every ${item} is within it`, `not every ${item} is within it`],
    assembly && [
      "Layers",
      assembly.status === "free",
      `nothing collides in ${layersOf(assembly.count)}`,
      `parts collide in all ${layersOf(assembly.count)}`,
    ],
    [isPractical ? "Practical limits" : "Limits", usable, "all are satisfied", "one or more are violated"],
  ];
  return rows.filter(Boolean).map(([name, good, satisfied, violated]) => [name, good, good ? satisfied : violated]);
}

export const reasons = (verdict, item) => (verdict.reasons ?? []).map((reason) => sentence(reason, item));

/**
 * Words of the service for people: without the names in parentheses that are for those who write requests, and with the
 * page's names of fields. Words in quotation marks stay as they are.
 */
export const plainWords = (words) =>
  words
    .replaceAll(/ \((?:see )?`[^)]*\)/g, "")
    .replace(/limits links (\w+)/, "the given $1 length")
    .replace("`allow_collisions` in `solids`", "“even where parts collide”")
    .replaceAll(/“[^”]*”|'[^' ]*'|"[^"]*"|`?\b(?:limits[. ])?([a-z]+(?:_[a-z]+)+)\b`?/gi, (all, name) =>
      name ? (LABELS[name.toLowerCase()] ?? spaced(name)) : all,
    )
    .replaceAll("`", "");

/** A note of a report in the page's words, as a sentence. */
export const plainNote = (note, item) => sentence(plainWords(note), item);
