// The requested motion as plain values: poses, crank angles, limits; its requests, CSV and links; its undo history.

const LIMITS = { family: "full_crank", transmission: 0, box: null, min: null, max: null };

export const emptyMotion = () => ({
  poses: [], wanted: "both", span: 90, direction: 1, even: true, limits: { ...LIMITS }, round: null, top: 8, extra: {},
});

const clone = (value) => JSON.parse(JSON.stringify(value));

/** The crank's travel from the first pose to each pose, in degrees, without sign. */
export function travels(motion) {
  const last = motion.poses.length - 1;
  if (motion.even || last < 1) return motion.poses.map((_, k) => (last < 1 ? 0 : (motion.span * k) / last));
  return motion.poses.map((pose) => pose.t);
}

/** Writes the crank angles into the poses, where they can then be changed one by one. */
export function fixTravels(motion) {
  travels(motion).forEach((t, k) => { motion.poses[k].t = t; });
}

/** Shifts and scales uneven crank angles so that they run from 0 to `span`. */
export function scaleTravels(motion, span) {
  const poses = motion.poses;
  const first = poses[0]?.t ?? 0, now = (poses.at(-1)?.t ?? 0) - first;
  if (now > 0) poses.forEach((pose) => { pose.t = ((pose.t - first) * span) / now; });
  motion.span = span;
}

/** The reason why a motion cannot be solved, as [sentence, field id]; null if there is none. */
export function fault(motion) {
  const { poses } = motion;
  if (poses.length < 3) return [`A motion needs at least three poses; there ${poses.length === 1 ? "is 1" : `are ${poses.length}`}.`, "add-row"];
  if (poses.length > 1024) return ["A motion has at most 1024 poses.", "poses"];
  if (!(motion.span >= 0.1 && motion.span <= 3600)) return ["The crank must turn by 0.1 to 3600 degrees.", "span"];
  if (!motion.even) {
    const bad = poses.findIndex((pose, k) => k > 0 && !(pose.t > poses[k - 1].t));
    if (bad > 0) return [`Crank angles must increase: that of pose ${bad + 1} is not larger than that of pose ${bad}.`, "poses"];
  }
  const box = motion.limits.box;
  if (box && !(box[0] <= box[2] && box[1] <= box[3])) return ["The pivot box needs left less than right and bottom less than top.", "box-0"];
  return null;
}

/** The body of POST /v1/synthesize. */
export function toRequest(motion) {
  const { poses, limits } = motion;
  const request = { ...motion.extra };
  if (motion.wanted !== "position") request.rotation = poses.map((pose) => pose.angle);
  if (motion.wanted !== "rotation") request.position = poses.map((pose) => [pose.x, pose.y]);
  if (motion.even) request.crank_span = motion.direction * motion.span;
  else request.crank_angle = poses.map((pose) => motion.direction * pose.t);
  request.top = motion.top;
  const asked = {};
  if (limits.family !== "full_crank") asked.family = limits.family;
  if (limits.transmission > 0) asked.transmission_angle_min = limits.transmission;
  if (limits.box && motion.wanted !== "rotation") asked.pivot_box = limits.box;
  if (limits.min) asked.link_min = limits.min;
  if (limits.max) asked.link_max = limits.max;
  if (Object.keys(asked).length) request.limits = asked;
  if (motion.round && motion.wanted !== "rotation") request.round_to = motion.round;
  return request;
}

const isNumbers = (list) => Array.isArray(list) && list.every(Number.isFinite);

/** The motion of a request. Throws Error for anything that is not a request. */
export function fromRequest(body) {
  const { rotation, position, crank_span, crank_angle, limits = {}, round_to, top, angle_unit, ...extra } = body ?? {};
  const unit = angle_unit === "rad" ? 180 / Math.PI : 1;
  const count = (rotation ?? position)?.length;
  if (!count || (rotation && !isNumbers(rotation)) || (position && !(Array.isArray(position) && position.every((p) => isNumbers(p) && p.length === 2))))
    throw new Error("This is not a request: it has neither a rotation nor positions.");
  if (rotation && position && rotation.length !== position.length)
    throw new Error(`There are ${rotation.length} angles and ${position.length} positions.`);
  if (crank_angle && !(isNumbers(crank_angle) && crank_angle.length === count))
    throw new Error(`The request has ${count} poses but not ${count} crank angles.`);
  if (!crank_angle && !Number.isFinite(crank_span)) throw new Error("The request has no crank span.");
  const motion = emptyMotion();
  const whole = (crank_angle ? crank_angle.at(-1) - crank_angle[0] : crank_span) * unit;
  motion.direction = whole < 0 ? -1 : 1;
  motion.span = Math.abs(whole);
  motion.even = !crank_angle;
  motion.wanted = rotation && position ? "both" : rotation ? "rotation" : "position";
  motion.poses = Array.from({ length: count }, (_, k) => ({
    t: crank_angle ? Math.abs(crank_angle[k] - crank_angle[0]) * unit : 0,
    x: position ? position[k][0] : 0,
    y: position ? position[k][1] : 0,
    angle: rotation ? rotation[k] * unit : 0,
  }));
  fixTravels(motion);
  motion.limits = {
    family: limits.family ?? "full_crank",
    transmission: (limits.transmission_angle_min ?? 0) * unit,
    box: limits.pivot_box ?? null, min: limits.link_min ?? null, max: limits.link_max ?? null,
  };
  motion.round = round_to ?? null;
  motion.top = top ?? 8;
  delete extra.budget_ms;
  motion.extra = extra;
  return motion;
}

const COLUMNS = { crank: "t", crank_angle: "t", theta1: "t", t: "t", x: "x", y: "y", angle: "angle", rotation: "angle", gamma: "angle" };

/**
 * `motion` with the poses of CSV rows. The columns are named in the first line or recognised by their number.
 * Throws Error with the number of the line.
 */
export function fromCsv(text, motion = emptyMotion()) {
  const lines = text.replace(/^\uFEFF/, "").split(/\r\n|\r|\n/).map((line, k) => [line.trim(), k + 1]).filter(([line]) => line && !line.startsWith("#"));
  if (!lines.length) throw new Error("There are no rows.");
  const sample = lines.at(-1)[0];
  const separator = sample.includes(";") ? /\s*;\s*/ : sample.includes("\t") ? /\s*\t\s*/ : sample.includes(",") ? /\s*,\s*/ : /\s+/;
  const decimalComma = !sample.includes(",") ? false : sample.includes(";") || sample.includes("\t");
  const cells = (line) => line.split(separator).map((cell) => cell.replace(/^"(.*)"$/, "$1"));
  const head = cells(lines[0][0]).map((name) => name.toLowerCase().replace(/[^a-z0-9_].*$/, ""));
  let names = head.map((name) => COLUMNS[name]);
  if (head.some((name) => name && Number.isNaN(Number(name.replace(",", "."))) && /^[a-z]/.test(name))) {
    lines.shift();
    if (!names.some(Boolean)) throw new Error("The first line names none of the columns crank, x, y, angle.");
  } else {
    names = { 4: ["t", "x", "y", "angle"], 3: ["x", "y", "angle"], 2: ["x", "y"] }[head.length];
    if (!names) throw new Error("Each row must hold crank, x, y, angle; or x, y, angle; or x, y.");
  }
  const used = [...names.entries()].filter(([, name]) => name);
  const poses = lines.map(([line, at]) => {
    const row = cells(line);
    const pose = { t: 0, x: 0, y: 0, angle: 0 };
    for (const [column, name] of used) {
      const cell = decimalComma ? row[column]?.replace(",", ".") : row[column];
      const value = cell ? Number(cell) : NaN;
      if (!Number.isFinite(value)) throw new Error(`Line ${at}: '${(row[column] ?? "").slice(0, 20)}' is not a number.`);
      pose[name] = value;
    }
    return pose;
  });
  if (poses.length > 1024) throw new Error(`There are ${poses.length} rows; at most 1024 are allowed.`);
  const has = (name) => names.includes(name);
  const next = { ...clone(motion), poses };
  const place = has("x") && has("y");
  next.wanted = place && has("angle") ? "both" : place ? "position" : "rotation";
  if (!place && !has("angle")) throw new Error("The rows need x and y, or an angle, or both.");
  if (has("t")) {
    const first = poses[0].t, whole = poses.at(-1).t - first;
    next.direction = whole < 0 ? -1 : 1;
    next.span = Math.abs(whole);
    poses.forEach((pose) => { pose.t = (pose.t - first) * next.direction; });
    const step = next.span / (poses.length - 1);
    next.even = poses.every((pose, k) => Math.abs(pose.t - k * step) <= 1e-9 * next.span);
  } else {
    next.even = true;
    fixTravels(next);
  }
  return next;
}

/** A further pose: at the place `at`, or by the step between the last two poses beyond the last. */
export function nextPose(motion, at = null) {
  const last = motion.poses.at(-1), before = motion.poses.at(-2);
  if (!last) return { t: 0, x: at?.[0] ?? 0, y: at?.[1] ?? 0, angle: 0 };
  const go = before ? { x: last.x - before.x, y: last.y - before.y, angle: last.angle - before.angle, t: last.t - before.t } : { x: 10, y: 0, angle: 0, t: 10 };
  return { t: last.t + (go.t > 0 ? go.t : 10), x: at?.[0] ?? last.x + go.x, y: at?.[1] ?? last.y + go.y, angle: at ? last.angle : last.angle + go.angle };
}

/** A value with undo and redo. Consecutive changes of the same `kind` (one drag, typing in one cell) are one step. */
export class History {
  constructor(value, onChange) {
    this.value = value;
    this.past = [];
    this.future = [];
    this.kind = null;
    this.onChange = onChange;
  }

  /** Applies `edit(value)`, which changes the value in place or returns another one. */
  change(edit, kind = null) {
    if (!kind || kind !== this.kind) {
      this.past.push(clone(this.value));
      if (this.past.length > 200) this.past.shift();
    }
    this.kind = kind;
    this.future = [];
    const made = edit(this.value);
    if (made) this.value = made;
    this.onChange(this.value);
  }

  /** Ends a step: the next change begins a new one. */
  settle() { this.kind = null; }

  #step(from, to) {
    if (!from.length) return;
    to.push(this.value);
    this.value = from.pop();
    this.kind = null;
    this.onChange(this.value);
  }

  undo() { this.#step(this.past, this.future); }

  redo() { this.#step(this.future, this.past); }
}

const toBase64 = (bytes) => {
  let text = "";
  for (const byte of bytes) text += String.fromCharCode(byte);
  return btoa(text).replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "");
};
const fromBase64 = (text) => Uint8Array.from(atob(text.replaceAll("-", "+").replaceAll("_", "/")), (c) => c.charCodeAt(0));
const through = async (bytes, stream) => new Uint8Array(await new Response(new Blob([bytes]).stream().pipeThrough(stream)).arrayBuffer());

/** A request as the fragment of a link, the part behind #. */
export async function toFragment(request) {
  const bytes = new TextEncoder().encode(JSON.stringify(request));
  if (typeof CompressionStream === "undefined") return `j=${toBase64(bytes)}`;
  return `z=${toBase64(await through(bytes, new CompressionStream("deflate-raw")))}`;
}

/** The request in the fragment of a link; null if there is none. Throws Error for a damaged one. */
export async function fromFragment(fragment) {
  const [, kind, text] = /^#?([zj])=(.+)$/.exec(fragment) ?? [];
  if (!kind) return null;
  try {
    const bytes = fromBase64(text);
    return JSON.parse(new TextDecoder().decode(kind === "z" ? await through(bytes, new DecompressionStream("deflate-raw")) : bytes));
  } catch (error) {
    throw new Error("The link is damaged: its motion cannot be read.", { cause: error });
  }
}
