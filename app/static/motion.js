// The requested motion as plain values: poses, crank angles, limits; its faults; its undo history.

export const clone = (value) => JSON.parse(JSON.stringify(value));

/** Units of length. */
export const UNITS = ["mm", "cm", "m", "in", "ft", "um"];

/** The practical limits of the service's preset by their names here; only `reach` has no field in a request. */
export const PRESET = { use: 35, turn: 15, ratio: 10, reach: 10 };

/**
 * `kept` says which of the practical limits hold; `transmission` (in use), `turn` and `ratio` are values that replace
 * theirs, or null. `family` is null for the service's default, see `familyOf`. `extra` holds fields without a field
 * here.
 */
const LIMITS = {
  family: null,
  kept: { use: true, turn: true, ratio: true, reach: true },
  transmission: null,
  turn: null,
  ratio: null,
  box: null,
  min: null,
  max: null,
  extra: {},
};

const STUDY_SAMPLES = 2000; // linkages of a tolerance study: the search is asked several times, and each answer has one

/**
 * `timing` says what is known of the crank angles: "free" (nothing), "even" (over `span`) or "table" (the `t` of each
 * pose). A pose is {t, x, y, angle}; x and y, or angle, are null where they are missing. Its weights and tolerances,
 * wr, wp, er, ep (rotation and position), are undefined where those of the whole motion hold. `prefer` is null for the
 * service's default. Only the page uses `unit`, `outline` (polylines from the body point at angle 0) and the `note` on
 * where the motion comes from. A function has no poses, but a `law`.
 */
export const emptyMotion = (prescribed = "both") => ({
  poses: [],
  wanted: prescribed,
  timing: "free",
  span: 90,
  direction: 1,
  anyOrder: false,
  closed: false,
  spanMax: null,
  startAngle: null,
  limits: clone(LIMITS),
  tolerance: { rotation: null, position: null },
  prefer: null,
  round: null,
  stock: null,
  analysis: { speed: null, force: [null, null], torque: null },
  study: { links: null, pivots: null, clearance: null, extra: { samples: STUDY_SAMPLES } },
  top: 8,
  diverse: true,
  mechanisms: "auto",
  unit: "mm",
  outline: null,
  note: "",
  law: null,
  extra: {},
});

/** Return true if the motion prescribes positions or angles, respectively; a function prescribes neither. */
export const wantsPlaces = (motion) => ["both", "position"].includes(motion.wanted);
export const wantsAngles = (motion) => ["both", "rotation"].includes(motion.wanted);

const NO_RATIO = 1e6; // a ratio of lengths that limits nothing

export const REPLACED = [
  ["use", "transmission", "transmission_angle_min", 0],
  ["turn", "turn", "transmission_angle_min_turn", 0],
  ["ratio", "ratio", "link_ratio_max", NO_RATIO],
];

/**
 * The practical limits of a request: the preset with what replaces its values, or without it those that are kept one by
 * one; `free` crank angles bring the preset with them unless it is declined.
 */
export function practical(limits, free) {
  const { kept } = limits,
    fields = kept.reach ? { preset: "practical" } : free ? { preset: "none" } : {};
  for (const [name, own, field, none] of REPLACED) {
    if (kept[name]) {
      if (limits[own] !== null || !kept.reach) fields[field] = limits[own] ?? PRESET[name];
    } else if (kept.reach) fields[field] = none;
  }
  return fields;
}

/** The families to search for: flaps swing, but closed paths and given crank angles need a crank that turns fully. */
export const familyOf = ({ limits, timing, closed }) =>
  limits.family ?? (timing === "free" && !closed && limits.turn === null ? "any" : "full_crank");

/** The unit of a linkage's lengths: without places its ground is 1. */
export const unitOf = (motion) => (motion.wanted === "rotation" ? "× ground" : motion.unit);

/** Return the name of a row of the motion. */
export const itemOf = (motion) => (wantsAngles(motion) ? "pose" : "point");

/** Return true if rails and slots are possible: they need positions, and angles unless the crank angles are free. */
export const slidable = (motion) => wantsPlaces(motion) && (wantsAngles(motion) || motion.timing === "free");

/** Return true if a preference can rank linkages: lengths need positions, swings need free crank angles. */
export const preferable = (motion, prefer) =>
  (prefer !== "size" || wantsPlaces(motion)) && (prefer !== "crank_span" || motion.timing === "free");

/** Return the position [x, y] of a pose; null if it is missing. */
export const placeOf = (pose) => (pose.x === null || pose.y === null ? null : [pose.x, pose.y]);

/** Return the prescribed positions. */
export const placesOf = (motion) => (wantsPlaces(motion) ? motion.poses.map(placeOf).filter(Boolean) : []);

/** The crank's travel from the first pose to each pose, in degrees, without sign; even ones where they are free. */
export function travels(motion) {
  const last = motion.poses.length - 1;
  if (motion.timing !== "table" || last < 1)
    return motion.poses.map((_, k) => (last < 1 ? 0 : (motion.span * k) / last));
  return motion.poses.map((pose) => pose.t);
}

/** Writes the crank angles into the poses, where they can then be changed one by one. */
export function fixTravels(motion) {
  for (const [k, t] of travels(motion).entries()) motion.poses[k].t = t;
}

/** Takes another `timing`; crank angles in the table begin as those that held before. */
export function setTiming(motion, timing) {
  if (timing === "table" && motion.timing !== "table") fixTravels(motion);
  takeTiming(motion, timing);
}

/** Set the timing. By default the practical limits are on if the crank angles are free, and off if they are given. */
export function takeTiming(motion, timing) {
  const { kept } = motion.limits,
    was = motion.timing === "free",
    is = timing === "free";
  if (Object.values(kept).every((isOn) => isOn === was)) for (const name of Object.keys(kept)) kept[name] = is;
  motion.timing = timing;
}

/** Shifts and scales uneven crank angles so that they run from 0 to `span`. */
export function scaleTravels(motion, span) {
  const { poses } = motion,
    first = poses[0]?.t ?? 0,
    now = (poses.at(-1)?.t ?? 0) - first;
  if (now > 0) for (const pose of poses) pose.t = ((pose.t - first) * span) / now;
  motion.span = span;
}

/** The reason why a motion cannot be solved, as [sentence, field id]; null if there is none. */
export function fault(motion) {
  const { poses, timing, span, anyOrder } = motion,
    { box, min, max } = motion.limits,
    [hasPositions, angles, free] = [wantsPlaces(motion), wantsAngles(motion), timing === "free"],
    kind = angles ? "motion" : "path",
    item = itemOf(motion),
    count = poses.length;
  const start = free ? "A" : "With given crank angles a",
    needs = `${start} ${kind} needs at least ${free ? "two" : "three"} ${item}s`,
    isBlank = (pose) => !(hasPositions && placeOf(pose)) && !(angles && pose.angle !== null),
    blank = poses.findIndex(isBlank),
    back = timing === "table" ? poses.findIndex((pose, k) => k > 0 && !(pose.t > poses[k - 1].t)) : -1,
    order = `that of ${item} ${back + 1} is not larger than that of ${item} ${back}`;
  const rules = [
    [count < (free ? 2 : 3), `${needs}; there ${count === 1 ? "is 1" : `are ${count}`}.`, "add-row"],
    [count > 1024, `A ${kind} has at most 1024 ${item}s.`, "poses"],
    [
      free && !hasPositions,
      "Free crank angles require positions, because nearly every linkage can produce angles alone.",
      "wanted",
    ],
    [
      free && anyOrder && !(angles && count > 2),
      "Any order requires at least three poses with both position and angle.",
      "any-order",
    ],
    [free && blank >= 0, `The row of ${item} ${blank + 1} is empty.`, "poses"],
    [hasPositions && !poses.some(placeOf), "No row has both x and y.", "poses"],
    [
      angles && poses.every((pose) => pose.angle === null),
      'No row has an angle. For a path choose "position only".',
      "wanted",
    ],
    [!free && !(span >= 0.1 && span <= 3600), "The crank must turn by 0.1 to 3600 degrees.", "span"],
    [back > 0, `Crank angles must increase: ${order}.`, "poses"],
    [min && max && min > max, `Links at least, ${min}, may not be more than links at most, ${max}.`, "link-min"],
    [
      box && !(box[0] <= box[2] && box[1] <= box[3]),
      "The pivot box needs left less than right and bottom less than top.",
      "box-0",
    ],
  ];
  return rules.find(([broken]) => broken)?.slice(1) ?? null;
}

/** A further pose: at the place `at`, or by the step between the last two poses beyond the last. */
export function nextPose(motion, at = null) {
  const last = motion.poses.at(-1),
    before = motion.poses.at(-2);
  if (!last) return { t: 0, x: at?.[0] ?? 0, y: at?.[1] ?? 0, angle: 0 };
  const [x, y] = placeOf(last) ?? [0, 0],
    [u, v] = (before && placeOf(before)) ?? [x - 10, y],
    turn = before ? (last.angle ?? 0) - (before.angle ?? 0) : 0,
    step = before ? last.t - before.t : 10;
  const [nextX, nextY] = at ?? [2 * x - u, 2 * y - v];
  return { t: last.t + (step > 0 ? step : 10), x: nextX, y: nextY, angle: (last.angle ?? 0) + (at ? 0 : turn) };
}

/**
 * A value with undo and redo. Consecutive changes of the same `kind` (one drag) are one step. What else a step
 * brings back is kept `beside`: `get()` returns it, `put(kept)` restores it.
 */
export class History {
  constructor(value, onChange, beside) {
    this.value = value;
    this.beside = beside;
    this.past = [];
    this.future = [];
    this.kind = null;
    this.onChange = onChange;
  }

  /** Keeps what there is, so that undo comes back to it. */
  keep(kind = null) {
    if (!kind || kind !== this.kind) {
      this.past.push([clone(this.value), this.beside.get()]);
      if (this.past.length > 200) this.past.shift();
    }
    this.kind = kind;
    this.future = [];
  }

  /** Applies `edit(value)`, which changes the value in place. */
  change(edit, kind = null) {
    this.keep(kind);
    edit(this.value);
    this.onChange(this.value);
  }

  /** Puts another value in place of this one; `clear()` removes what is beside it. */
  replace(value, clear) {
    this.keep();
    clear();
    this.value = value;
    this.onChange(value);
  }

  /** Ends a step: the next change begins a new one. */
  settle() {
    this.kind = null;
  }

  #step(from, to) {
    if (!from.length) return;
    to.push([this.value, this.beside.get()]);
    const [value, context] = from.pop();
    Object.assign(this, { value, kind: null });
    this.beside.put(context);
    this.onChange(this.value);
  }

  undo() {
    this.#step(this.past, this.future);
  }

  redo() {
    this.#step(this.future, this.past);
  }
}

/** Angles without jumps by whole turns: each within half a turn of the one before. */
export function unwrapped(angles) {
  let before = null;
  return angles.map((angle) => {
    if (angle === null) return null;
    before = before === null ? angle : Number((angle + 360 * Math.round((before - angle) / 360)).toPrecision(12));
    return before;
  });
}

/** The first two poses, from 1, between which the angle jumps by more than half a turn; null without such a jump. */
export function jump(motion) {
  if (!wantsAngles(motion)) return null;
  const rows = motion.poses.map(({ angle }, k) => [angle, k + 1]).filter(([angle]) => angle !== null);
  const at = rows.findIndex(([angle], k) => k > 0 && Math.abs(angle - rows[k - 1][0]) > 180);
  return at < 0 ? null : [rows[at - 1][1], rows[at][1]];
}

/** Return true if the angles look like radians: all are within a turn in radians, and most are not simple numbers. */
export function looksRadian(motion) {
  const angles = motion.poses.map(({ angle }) => angle).filter((angle) => angle !== null),
    odd = angles.filter((angle) => (2 * angle) % 1 !== 0);
  const isSmall = angles.every((angle) => Math.abs(angle) < 6.2832),
    range = Math.max(...angles) - Math.min(...angles);
  return wantsAngles(motion) && angles.length > 2 && isSmall && range > 0.1 && 2 * odd.length >= angles.length;
}

/** Drops a last pose that repeats the first, which makes the motion closed; whether there was one. */
export function dropClosing(motion) {
  const { poses, timing } = motion,
    [first, last] = [poses[0], poses.at(-1)];
  if (timing !== "free" || !wantsPlaces(motion) || poses.length < 5) return false;
  const from = ({ x, y }) => Math.hypot(x - first.x, y - first.y),
    turn = wantsAngles(motion) ? Math.abs(last.angle - first.angle) % 360 : 0;
  if (!placeOf(first) || !placeOf(last) || Math.min(turn, 360 - turn) > 1e-6) return false;
  if (from(last) > 1e-6 * Math.max(...poses.filter(placeOf).map(from))) return false;
  poses.pop();
  motion.closed = true;
  return true;
}

/** The first two neighbouring poses, from 1, that ask for the same place and angle; null without such. */
export function repeated(motion) {
  const isSame = (pose, reference) => ["x", "y", "angle"].every((name) => pose[name] === reference[name]);
  const at = motion.poses.findIndex((pose, k) => k > 0 && isSame(pose, motion.poses[k - 1]));
  return at < 0 ? null : [at, at + 1];
}
