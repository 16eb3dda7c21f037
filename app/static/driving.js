// The drive of the selected linkage: asks for cylinders, motors, locks and springs; the ends of one can be dragged.

import { redrawOn, titledChart } from "./charts.js";
import { BEST, KINDS, armUnit, factsOf, nameOf, optionsOf, plain, rowsOf } from "./choices.js";
import { numberIn, numbersIn } from "./decimal.js";
import { button, definitions, element, make, namedRows, pathData, put, text } from "./drawing.js";
import { alike, fitOf } from "./fit.js";
import { itemOf } from "./motion.js";
import { RAD, add, less, turned } from "./plane.js";
import { ask } from "./service.js";
import { $, capital, listen } from "./shell.js";
import { driveTurns } from "./timing.js";

const WIDE = 0.09; // of a cylinder's body, over its retracted length
const HANDLE = 8; // pixels
const EARLIER = "These results belong to earlier entries. Press Find to search again.";
const AGAIN = "Searching again. The results shown belong to the linkage before it was moved.";
/** Fields of the request for each kind of spring. */
const SPRINGS = { tension: { catalogue: "tension_springs" }, gas: {}, compression: {}, torsion: {} };

const value = (id) => numberIn(`drive-${id}`);
const checked = (id) => $(`drive-${id}`).checked;
const filledIn = (fields) =>
  Object.fromEntries(Object.entries(fields).filter(([, content]) => content !== null && content !== ""));
/** Return the part of a request that comes from the fields, without the data of the linkage. */
const questionOf = ({ load, drives, springs }) => JSON.stringify({ load, drives, springs });
/** Return numbers that belong together, null if all are blank. Throws an error if only some are blank. */
function together(ids, sentence) {
  const numbers = ids.map(value);
  if (numbers.every((number) => number === null)) return null;
  if (numbers.includes(null)) throw new Error(sentence);
  return numbers;
}
/** The behaviour that springs of a catalogue are asked for. */
function behaviour() {
  const [open, closed] = ["holds-open", "holds-closed"].map(checked),
    curve = numbersIn("drive-wanted", 2, true);
  return filledIn({
    holds: open || closed ? { open, closed, ...filledIn({ force_min: value("hold-force") }) } : null,
    hand_force_max: value("hand-force"),
    target: curve && { [$("drive-wanted-of").value]: curve },
    count: value("count"),
  });
}
/** The load in the fields. */
function loadOf() {
  const force = [value("force-x") ?? 0, value("force-y") ?? 0],
    acts = force.some(Boolean),
    mass = value("mass"),
    link = $("drive-on").value;
  return filledIn({
    force: acts && link === "body" ? force : null,
    forces: acts && link !== "body" ? [{ link, force }] : null,
    torque: value("torque"),
    masses: mass ? [{ link, mass }] : null,
    parts: checked("parts") || null,
  });
}

/** The joints of a four-bar's links: from them an arm leads to a pin of a drive. */
const JOINTS = { crank: (j) => [j.a, j.d], coupler: (j) => [j.d, j.c], rocker: (j) => [j.b, j.c] };

/** Lines of the arms that carry the ends of a drive on links of a four-bar: [[joint, end, joint], ..]. */
function armsOf(drive, joints, ground, pin) {
  const arm = (link, end) => {
    const [first, last] = (end && joints.a && JOINTS[link]?.(joints)) || [];
    return first ? [[first, end, last]] : [];
  };
  return [...arm(drive.link, pin), ...arm(drive.base_link, ground)];
}

/** The value of a curve at a place between its even steps, numbers or points. */
function between({ crank_angle: x }, values, at) {
  const last = x.length - 1,
    share = Math.min(1, Math.max(0, (at - x[0]) / (x[last] - x[0] || 1))) * last,
    k = Math.min(last - 1, Math.floor(share)),
    mix = (start, end) => start + (share - k) * (end - start);
  const [lower, upper] = [values[k], values[k + 1]];
  if (lower === null || upper === null) return null;
  return Array.isArray(lower) ? lower.map((part, i) => mix(part, upper[i])) : mix(lower, upper);
}

/** Slopes of values at even steps, at the ends too those of a parabola. */
function slopesOf(values, step) {
  const slope = (_, k) => {
    const j = Math.min(Math.max(k, 1), values.length - 2),
      [before, middle, after] = values.slice(j - 1, j + 2);
    return ((after - before) / 2 + (k - j) * (after - 2 * middle + before)) / step;
  };
  return values.map(slope);
}

/** A drive with other ends, its lengths, arms and forces computed here from the torque of the load. */
function moved(drive, linkage, torque) {
  const { crank_angle: at } = drive.curve,
    frames = at.map((angle) => linkage.at(angle * RAD).frames[drive.link]),
    pin = frames.map((frame) => add(frame.at, turned(drive.pin_on_link, frame.angle))),
    ground = at.map(() => drive.ground_point),
    length = pin.map((point) => Math.hypot(...less(point, drive.ground_point))),
    arm = slopesOf(length, (at[1] - at[0]) * RAD),
    turns = arm.findIndex((rate) => rate * arm[0] <= 0),
    ends = [length[0], length.at(-1)],
    stroke = Math.abs(ends[1] - ends[0]);
  const force = turns < 0 && drive.curve.force ? arm.map((rate, k) => torque.torque[k] / rate / drive.count) : null,
    peak_force = force && Math.max(...force.map(Math.abs)),
    peak_force_bound = force && torque.amount / stroke / drive.count;
  return {
    ...drive,
    name: null,
    price: null,
    pin: pin[0],
    length: ends,
    retracted: Math.min(...length),
    stroke,
    extends: ends[1] > ends[0],
    arm_min: Math.min(...arm.map(Math.abs)),
    peak_force,
    peak_force_bound,
    peak_force_ratio: peak_force && peak_force / peak_force_bound,
    byHand: true,
    dead: turns < 0 ? null : at[turns],
    curve: { ...drive.curve, ground, pin, length, arm, force },
  };
}

export class Driving {
  answer = null;
  solution = null;
  reply = null;
  drive = null;
  control = null;
  options = [];
  charts = [];
  kept = new WeakMap(); // the reply for each solution
  asked = new WeakMap(); // the question of each reply

  /** `chosen()` is called when another drive is shown, or none. */
  constructor(board, player, chosen) {
    Object.assign(this, { board, player, chosen });
    listen("drive-find", "click", () => this.#find());
    listen("drive-kind", "change", () => this.#offer());
    listen("drive-catalogue", "change", () => {
      this.#offer();
      if ($("drive-catalogue").value === "own") $("drive-file").click();
    });
    listen("drive-file", "change", async () => {
      const [file] = $("drive-file").files;
      this.table = await file?.text();
      this.#say(file ? `Rows of ${file.name}.` : "");
    });
    for (const name of ["input", "change"]) $("drive-card").addEventListener(name, () => this.#compare(), true);
    listen("drive-card", "keydown", (event) => {
      if (event.key !== "Enter" || !event.target.matches("input, select")) return;
      event.preventDefault();
      this.#find();
    });
    board.driven = () => this.lines().flat();
    board.seen.push(() => this.#draw());
    board.redrawn.push(() => this.#draw());
    redrawOn($("drive-curves"), () => this.#curves());
    this.#offer();
  }

  /** A new answer; while a linkage like the one before stays selected, so does what was found for it. */
  show(answer) {
    this.answer = answer;
    $("drive-card").hidden = !answer?.reply.solutions.length;
  }

  /**
   * Selects a solution and shows what was found for it before. A question that is under way continues for a linkage
   * like the one before; for one that has been moved from it, it is asked again.
   */
  select(solution) {
    const before = this.solution,
      isUnchanged =
        before === solution || (before && solution && solution.source !== "moved" && alike(before, solution)),
      question = this.asked.get(this.reply) ?? this.pending;
    this.solution = solution;
    if (isUnchanged) {
      if (this.kept.has(before)) this.kept.set(solution, this.kept.get(before));
      this.#compare();
      return;
    }
    this.control?.abort();
    if (solution?.source === "moved" && question && !this.kept.has(solution)) {
      this.#find(JSON.parse(question));
      return;
    }
    this.#use(this.kept.get(solution) ?? null);
    this.#say("");
    this.#compare();
  }

  /** Show a message if fields have changed since the shown drive was found, because its forces are of another load. */
  #compare() {
    if (!this.reply) return;
    let question = "";
    try {
      question = questionOf(this.#request());
    } catch {
      /* it cannot be asked as it is */
    }
    const earlier = question !== this.asked.get(this.reply);
    $("drive-card").classList.toggle("other", earlier);
    if (earlier) this.#say(EARLIER);
    else if ($("drive-note").textContent === EARLIER) this.#say("");
  }

  /** Drive that is shown, which is exported with the linkage. */
  get shown() {
    return this.drive && this.drive.kind ? this.drive : null;
  }

  /** Units and names in the shown numbers. */
  get #how() {
    const { motion } = this.answer;
    return { unit: motion.unit, turns: driveTurns(this.solution), item: itemOf(motion) };
  }

  #offer() {
    const kind = $("drive-kind").value,
      own = $("drive-catalogue").value;
    for (const part of document.querySelectorAll("#drive-card [data-kinds]"))
      part.hidden = !part.dataset.kinds.split(" ").includes(kind);
    for (const part of document.querySelectorAll("#drive-card [data-sizes]")) part.hidden ||= own !== "";
  }

  #say(words, bad = false) {
    $("drive-note").textContent = words;
    $("drive-note").classList.toggle("bad", bad);
  }

  /** The part of a question that says which linkage it is about. */
  get #about() {
    const { request, within = request, motion } = this.answer;
    return { linkage: this.solution, request: within, length_unit: motion.unit, top: BEST };
  }

  #request() {
    const kind = $("drive-kind").value,
      catalogue = $("drive-catalogue").value,
      reach_max = value("reach");
    const sides = [0, 1, 2, 3].map((k) => `box-${k}`),
      box = together(sides, "Where may it be mounted? Give all four sides of the box, or none of them.");
    const ground_box = box,
      question = { ...this.#about, load: loadOf(), drives: [] };
    if (kind === "ideal") return { ...question, springs: [{ kind: "tension" }] };
    const kinds = Object.keys(SPRINGS).filter((name) => kind === name || kind === "springs"),
      spring = (name) => ({
        kind: name,
        ...SPRINGS[name],
        ...behaviour(),
        ...(box && name !== "torsion" && { ground_box }),
      });
    if (kinds.length) return { ...question, springs: kinds.map(spring) };
    const sized = catalogue === "",
      sizes = sized
        ? { retracted: value("retracted"), stroke: value("stroke") }
        : { catalogue: catalogue === "own" ? (this.table ?? "") : catalogue };
    const cylinder = kind === "actuator",
      sentence = "Ends: give x and y of the ground point and of the pin, or none of them.",
      ends = cylinder ? together(["ground-x", "ground-y", "pin-x", "pin-y"], sentence) : null,
      fixed = ends && { links: [$("drive-link").value], ground_point: ends.slice(0, 2), pin: ends.slice(2) };
    const count = cylinder ? value("count") : null,
      pinBox = cylinder && !ends ? numbersIn("drive-pin-box", 4) : null;
    const wishes = {
      rotary: {},
      actuator: { ...sizes, ...fixed, reach_max, count, ground_box: ends ? null : box, pin_box: pinBox },
      dyad: { time_ratio: value("ratio"), reach_max, motor_box: box },
      toggle: { reach_max, ground_box },
    };
    const drives = kind === "any" ? ["rotary", "actuator", "dyad"] : [kind];
    return { ...question, drives: drives.map((name) => ({ kind: name, ...filledIn(wishes[name]) })) };
  }

  /** Asks what the fields say, or for a linkage that was moved `again` what was asked for the one before. */
  async #find(again = null) {
    if (!this.solution) return;
    this.control?.abort();
    const control = new AbortController(),
      by = again && this.drive?.byHand ? this.drive : null;
    this.control = control;
    this.#say(again ? AGAIN : "Looking…");
    try {
      const request = again ? { ...this.#about, ...again } : this.#request();
      this.pending = questionOf(request);
      const reply = await (await ask("/v2/drives", request, control.signal)).json();
      if (control.signal.aborted) return;
      this.kept.set(this.solution, reply);
      this.asked.set(reply, this.pending);
      const found = reply.drives.length + reply.springs.length;
      this.#use(reply, again && this.drive?.kind);
      if (by && this.drive?.kind === by.kind) this.#moveBy(by, this.drive);
      if (!again) this.board.reveal(this.board.driven());
      const because = reply.refused.length ? ", because of what is listed below" : "",
        none = found ? [] : [`No sensible ${request.springs ? "spring" : "drive"}${because}.`];
      this.#say([...none, ...reply.notes.map((sentence) => `${capital(sentence)}.`)].join(" "), !found);
      this.#compare();
    } catch (error) {
      if (error.name === "AbortError") return;
      if (again) this.#use(null);
      this.#say(error.message, true);
    } finally {
      if (this.control === control) this.pending = null;
    }
  }

  /** Shows a reply, and of its options that of a kind if there is one. */
  #use(reply, kind = null) {
    this.reply = reply;
    this.options = reply ? optionsOf(reply) : [];
    this.#choose(this.options.find((option) => option.kind === kind) ?? this.options[0] ?? null);
  }

  #choose(drive) {
    this.drive = drive;
    this.#list();
    $("drive-numbers").replaceChildren(...(drive ? [namedRows(this.rows())] : []));
    this.#curves();
    this.#draw();
    this.chosen();
  }

  /** Chooses a drive whose ends were put by hand, `from` one of the options. */
  #moveBy(drive, from) {
    const { linkage } = fitOf(this.solution, this.answer.motion);
    this.#choose({ ...moved(drive, linkage, this.reply.torque), from });
  }

  #list() {
    const refused = this.reply?.refused ?? [];
    const cards = this.options.map((drive) => {
      const act = () => {
        this.#choose(drive);
        this.board.reveal(this.board.driven());
      };
      const pressed = drive === this.drive || (this.drive?.byHand && this.drive.from === drive),
        card = button("", act, "", { "aria-pressed": String(Boolean(pressed)) });
      card.append(element("strong", "", nameOf(drive)), definitions(factsOf(drive, this.#how)));
      return card;
    });
    $("drive-found").replaceChildren(...cards);
    $("drive-found").hidden = !cards.length;
    $("drive-reasons").hidden = !refused.length;
    $("drive-reasons").open = !cards.length;
    $("drive-refused").replaceChildren(
      ...refused.map(({ kind, link, name, reason }) => {
        const sort = KINDS[kind] ? `${KINDS[kind]} on the ${plain(link)}` : `${kind} spring, ${link}`;
        const why = reason.replace("reach_max", "“pin within”");
        return element("li", "", `${sort}${name ? ` (${name})` : ""}: ${why}.`);
      }),
    );
  }

  /** Rows [name, value] of what is shown: for the card and for the sheet. */
  rows() {
    return this.drive ? rowsOf(this.drive, this.#how) : [];
  }

  /** Return the parts of the drive at the first pose as lines, for the sheet. */
  lines() {
    const { drive } = this;
    if (!drive) return [];
    if (drive.springs) return drive.springs.map(({ points, point }) => points ?? [point]);
    if (drive.kind === "rotary") return [[drive.motor]];
    const { ground, knee, pin } = drive.curve,
      joints = this.solution.links ? fitOf(this.solution, this.answer.motion).at[0] : null,
      arms = joints ? armsOf(drive, joints, ground[0], pin[0]) : [];
    return [[ground[0], knee?.[0], pin[0]].filter(Boolean), ...arms];
  }

  /** Force, torque and arm over the way, the force beside the least peak that any cylinder of this stroke has. */
  #curves() {
    const host = $("drive-curves"),
      { drive, reply } = this;
    host.replaceChildren();
    this.charts = [];
    if (!drive || $("drive-card").hidden) return;
    const sense = this.player.shown?.pass.sense ?? 1,
      { unit, turns } = this.#how,
      axis = turns ? { sense } : { sense, degreesX: false, xName: ` ${unit}` },
      x = (drive.springs?.[0] ?? drive).curve.crank_angle,
      order = [...x.keys()].sort((i, j) => sense * (x[i] - x[j])),
      inOrder = (values) => order.map((k) => values[k]);
    const plot = (title, ...series) => {
      const curves = series.map((curve) => ({ ...curve, values: inOrder(curve.values) })),
        options = { x: inOrder(x).map((at) => sense * at), series: curves, height: 140, ...axis };
      this.charts.push(titledChart(host, title, options));
    };
    const thin = { dash: [6, 4], width: 1.2 };
    if (drive.springs) {
      plot(
        `Torque of the drive with the springs, N·${unit} (dashed: without)`,
        { values: drive.springs[0].curve.torque, colour: "body" },
        { values: reply.torque.torque, colour: "muted", ...thin },
      );
      return;
    }
    const { curve, kind, peak_force_bound: bound } = drive,
      level = bound ? [{ values: x.map(() => bound), colour: "box", ...thin }] : [];
    const name = { dyad: "Torque of the motor, forwards", toggle: "Torque at the handle" }[kind] ?? "Torque",
      dashed = bound ? " (dashed: no peak is below this)" : "";
    if (curve.force)
      plot(
        `Force of the ${KINDS[kind]}, push or pull, N${dashed}`,
        { values: curve.force.map(Math.abs), colour: "body" },
        ...level,
      );
    if (curve.torque) plot(`${name}, N·${unit}`, { values: curve.torque, colour: "body" });
    if (curve.arm) plot(`Moment arm, ${armUnit(unit, turns)}`, { values: curve.arm.map(Math.abs), colour: "path" });
    this.#mark();
  }

  #mark() {
    if (this.board.joints) for (const plot of this.charts) plot.mark(Number($("slider").value));
  }

  /** The drive on the canvas at the crank's place: its parts, and handles at its ends. */
  #draw() {
    const { board, drive, solution } = this,
      { driveLayer: layer, joints } = board;
    if (solution === this.player.shown?.solution) this.#mark();
    // an end that has the keys keeps them when it is drawn anew
    this.focused = layer.contains(document.activeElement) ? document.activeElement.dataset.end : null;
    layer.replaceChildren();
    if (!drive || !joints || !board.linkage || board.stale || solution !== this.player.shown?.solution) return;
    const at = this.player.shown.pass.turns ? joints.travel / RAD : this.player.travel;
    if (drive.springs) for (const spring of drive.springs) this.#drawSpring(spring, at);
    else if (drive.kind === "rotary") this.#dot(drive.motor, "motor");
    else {
      const { curve } = drive,
        [ground, pin, knee] = ["ground", "pin", "knee"].map((name) =>
          curve[name] ? between(curve, curve[name], at) : drive.motor,
        );
      if (!ground || !pin) return;
      if (solution.links) for (const arm of armsOf(drive, joints, ground, pin)) this.#line("arm", arm);
      if (curve.knee && knee) {
        this.#line("rod", [ground, knee, pin]);
        for (const joint of [ground, knee, pin]) this.#dot(joint, "joint");
      } else this.#drawCylinder(ground, pin);
    }
  }

  #drawSpring({ curve, kind, point, between: links }, at) {
    // a torsion spring between two moving links is shown only by its numbers
    if (kind === "torsion") {
      if (links.includes("ground")) this.#dot(point, "motor");
      return;
    }
    const pairs = curve.ends.map((pair) => pair.flat()),
      ends = between(curve, pairs, at);
    if (ends) this.#line(kind === "gas" ? "rod" : "spring", [ends.slice(0, 2), ends.slice(2)]);
  }

  #drawCylinder(ground, pin) {
    const { drive, solution } = this,
      rod = less(pin, ground),
      length = Math.hypot(...rod),
      [x, y] = rod.map((part) => part / length),
      body = 0.85 * drive.retracted,
      half = (WIDE / 2) * drive.retracted,
      corner = (along, across) => add(ground, [x * along - y * across, y * along + x * across]);
    const low = 0.04 * body,
      corners = [corner(low, half), corner(body, half), corner(body, -half), corner(low, -half)];
    this.#line("rod", [ground, pin]);
    this.#line("cylinder", corners, true);
    const free = drive.base_link === "ground" && Boolean(JOINTS[drive.link]) && Boolean(solution.links);
    this.#handle(ground, "ground", free);
    this.#handle(pin, "pin", free);
    put(this.board.driveLayer, { "data-length": text(length, 6) });
  }

  #line(name, points, closed = false) {
    const { view, driveLayer } = this.board;
    make("path", { class: `drive-${name}`, d: pathData(points, view) + (closed ? "Z" : "") }, driveLayer);
  }

  #dot(position, name) {
    const [cx, cy] = this.board.view.at(position);
    return make("circle", { class: `drive-${name}`, cx, cy, r: name === "motor" ? 12 : 5 }, this.board.driveLayer);
  }

  /** An end of a cylinder, which drags and arrow keys move. */
  #handle(position, end, free) {
    const dot = this.#dot(position, "end"),
      label = `${end === "ground" ? "Ground point" : "Pin"} of the cylinder: drag, or arrow keys`;
    if (!free) return;
    put(dot, { r: HANDLE, tabindex: 0, role: "button", "data-end": end, "aria-label": label });
    if (this.focused === end) dot.focus({ preventScroll: true });
    dot.addEventListener("keydown", (event) => {
      const by = this.board.nudge(event);
      if (!by) return;
      event.preventDefault();
      event.stopPropagation();
      this.#put(end, add(position, by));
    });
    dot.addEventListener("pointerdown", (event) => {
      const move = (px, py) => this.#put(end, this.board.view.world(px, py));
      event.stopPropagation();
      this.player.stop();
      this.board.follow(event, move, () => {});
    });
  }

  /** One end is put elsewhere by hand, where the crank stands now. */
  #put(end, position) {
    const { drive } = this,
      { at, angle } = this.board.joints.frames[drive.link];
    const ends = end === "ground" ? { ground_point: position } : { pin_on_link: turned(less(position, at), -angle) };
    this.#moveBy({ ...drive, ...ends }, drive.from ?? drive);
  }
}
