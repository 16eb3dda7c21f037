// What drives the selected linkage: asks for cylinders, motors, locks and springs, moves one, and lets its pins be dragged.

import { redrawOn, titledChart } from "./charts.js";
import { BEST, KINDS, factsOf, grouped, nameOf, optionsOf, plain } from "./choices.js";
import { numberIn } from "./decimal.js";
import { button, element, make, namedRows, put, text } from "./drawing.js";
import { driveTurns } from "./drive.js";
import { alike, fitOf, settled } from "./fit.js";
import { itemOf } from "./motion.js";
import { RAD, add, less, turned } from "./plane.js";
import { ask } from "./service.js";
import { $, capital } from "./shell.js";

const FIELDS = [
  "kind",
  "catalogue",
  "retracted",
  "stroke",
  "ratio",
  "reach",
  "force-x",
  "force-y",
  "torque",
  "mass",
  "holds-open",
  "holds-closed",
  "hold-force",
  "hand-force",
  "wanted-first",
  "wanted-last",
  "count",
  "link",
  "ground-x",
  "ground-y",
  "pin-x",
  "pin-y",
  "on",
  "parts",
  "box-0",
  "box-1",
  "box-2",
  "box-3",
];
const WIDE = 0.09; // of a cylinder's body, over its retracted length
const HANDLE = 8; // pixels
const EARLIER = "What is shown was found for other entries: Find asks again.";

const value = (id) => numberIn(`drive-${id}`);
const given = (fields) => Object.fromEntries(Object.entries(fields).filter(([, one]) => one !== null && one !== ""));
/** What the fields have asked, whatever the service has said of the linkage since. */
const questionOf = ({ load, drives, springs }) => JSON.stringify({ load, drives, springs });
/** The behaviour that springs of a catalogue are asked for. */
function behaviour() {
  const open = $("drive-holds-open").checked,
    closed = $("drive-holds-closed").checked,
    first = value("wanted-first"),
    last = value("wanted-last");
  const holds = open || closed ? { open, closed, ...given({ force_min: value("hold-force") }) } : null;
  return given({
    holds,
    hand_force_max: value("hand-force"),
    target: first === null && last === null ? null : { torque: [first ?? last, last ?? first] },
    count: value("count"),
  });
}
/** Both ends of a cylinder that are given at the first pose, and its link; nothing if they are free. */
function givenEnds() {
  const [ground, pin] = ["ground", "pin"].map((end) => [value(`${end}-x`), value(`${end}-y`)]);
  if ([...ground, ...pin].every((one) => one === null)) return {};
  if ([...ground, ...pin].includes(null))
    throw new Error("Ends: give x and y of the ground point and of the pin, or none of them.");
  return { links: [$("drive-link").value], ground_point: ground, pin };
}
/** The box in which ends on the ground must lie; null without one. */
function mountingBox() {
  const box = [0, 1, 2, 3].map((k) => value(`box-${k}`));
  if (box.every((one) => one === null)) return null;
  if (box.includes(null)) throw new Error("Where may it be mounted? Give all four sides of the box, or none of them.");
  return box;
}

/** The joints of a four-bar's links: from them an arm leads to a pin of a drive. */
const JOINTS = { crank: (j) => [j.a, j.d], coupler: (j) => [j.d, j.c], rocker: (j) => [j.b, j.c] };

/** Lines of the arms that carry the ends of a drive on links of a four-bar: [[joint, end, joint], ..]. */
const armsOf = (drive, joints, ground, pin) =>
  [
    [drive.link, pin],
    [drive.on, ground],
  ].flatMap(([link, end]) =>
    JOINTS[link] && joints.a && end ? [[JOINTS[link](joints)[0], end, JOINTS[link](joints)[1]]] : [],
  );

/** The value of a curve at a place between its even steps, numbers or points. */
function between(curve, values, at) {
  const x = curve.crank_angle,
    last = x.length - 1,
    share = Math.min(1, Math.max(0, (at - x[0]) / (x[last] - x[0] || 1))) * last,
    k = Math.min(last - 1, Math.floor(share)),
    t = share - k;
  const [one, other] = [values[k], values[k + 1]];
  if (one === null || other === null) return null;
  return Array.isArray(one) ? one.map((part, i) => part + t * (other[i] - part)) : one + t * (other - one);
}

/** The unit of a moment arm: a change of length by the angle, or by the travel, of what drives the linkage. */
const armUnit = (unit, turns) => (turns ? `${unit} a radian` : `${unit} a ${unit} of travel`);

/** A drive with other ends, its lengths, arms and forces computed here from the torque of the load. */
function moved(drive, linkage, torque) {
  const { crank_angle: at } = drive.curve,
    joints = at.map((angle) => linkage.at(angle * RAD));
  const pin = joints.map(({ frames: { [drive.link]: frame } }) =>
    add(frame.at, turned(drive.pin_on_link, frame.angle)),
  );
  const ground = at.map(() => drive.ground_point),
    length = pin.map((place, k) => Math.hypot(...less(place, ground[k])));
  // slopes at even steps: of second order, at the ends too
  const step = (at[1] - at[0]) * RAD,
    n = length.length,
    arm = length.map(
      (_, k) =>
        (k === 0
          ? -3 * length[0] + 4 * length[1] - length[2]
          : k === n - 1
            ? 3 * length[k] - 4 * length[k - 1] + length[k - 2]
            : length[k + 1] - length[k - 1]) /
        (2 * step),
    );
  const force = drive.curve.force && arm.map((one, k) => torque.torque[k] / one / drive.count),
    turns = arm.findIndex((one) => one * arm[0] <= 0);
  const stroke = Math.abs(length.at(-1) - length[0]),
    peak = force && turns < 0 ? Math.max(...force.map(Math.abs)) : null,
    bound = peak === null ? null : torque.amount / stroke / drive.count;
  return {
    ...drive,
    name: null,
    price: null,
    pin: pin[0],
    length: [length[0], length.at(-1)],
    retracted: Math.min(...length),
    stroke,
    extends: length.at(-1) > length[0],
    arm_min: Math.min(...arm.map(Math.abs)),
    peak_force: peak,
    peak_force_bound: bound,
    peak_force_ratio: peak && peak / bound,
    byHand: true,
    dead: turns < 0 ? null : at[turns],
    curve: { ...drive.curve, ground, pin, length, arm, force: turns < 0 ? force : null },
  };
}

export class Driving {
  constructor(board, player) {
    Object.assign(this, {
      board,
      player,
      answer: null,
      solution: null,
      reply: null,
      drive: null,
      control: null,
      charts: [],
      kept: new WeakMap(),
      asked: new WeakMap(),
    });
    $("drive-find").addEventListener("click", () => this.#find());
    $("drive-kind").addEventListener("change", () => this.#offer());
    $("drive-catalogue").addEventListener("change", () => {
      this.#offer();
      if ($("drive-catalogue").value === "own") $("drive-file").click();
    });
    $("drive-file").addEventListener("change", async () => {
      const [file] = $("drive-file").files;
      this.table = await file?.text();
      this.#say(file ? `Rows of ${file.name}.` : "");
    });
    for (const id of FIELDS)
      for (const name of ["input", "change"]) $(`drive-${id}`).addEventListener(name, () => this.#compare());
    for (const id of FIELDS)
      $(`drive-${id}`).addEventListener("keydown", (event) => {
        if (event.key === "Enter") {
          event.preventDefault();
          this.#find();
        }
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
   * The selected solution; what was found for it before is shown again. A question that is under way goes on for a linkage like the one
   * before; for one that has been moved from it, it is asked again.
   */
  select(solution) {
    const before = this.solution,
      same = before === solution || (before && solution && solution.source !== "moved" && alike(before, solution)),
      asked = this.asked.get(this.reply) ?? this.pending;
    this.solution = solution;
    if (same) {
      if (this.kept.has(before)) this.kept.set(solution, this.kept.get(before));
      this.#compare();
      return;
    }
    this.control?.abort();
    if (solution?.source === "moved" && asked && !this.kept.has(solution)) {
      this.#find(JSON.parse(asked));
      return;
    }
    this.#use(this.kept.get(solution) ?? null);
    this.#say("");
    this.#compare();
  }

  /** Says so where fields have changed since what is shown was found: its forces are those of another load. */
  #compare() {
    if (!this.reply) return;
    let asked = "";
    try {
      asked = questionOf(this.#request());
    } catch {
      /* it cannot be asked as it is */
    }
    const earlier = asked !== this.asked.get(this.reply);
    $("drive-card").classList.toggle("other", earlier);
    if (earlier) this.#say(EARLIER);
    else if ($("drive-note").textContent === EARLIER) this.#say("");
  }

  /** What is exported with the linkage: the drive that is shown. */
  get shown() {
    return this.drive && this.drive.kind ? this.drive : null;
  }

  /** Whether forces are newtons: a mass, a bundled catalogue or its gas springs say so. Else they have the load's own unit. */
  get #newtons() {
    return /"masses"|"catalogue":"\w+"|"gas"|"compression"|"torsion"/.test(this.asked.get(this.reply));
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
  #about() {
    const {
      solution,
      answer: { request, motion },
    } = this;
    return { linkage: solution, request, length_unit: motion.unit, top: BEST };
  }

  #request() {
    const kind = $("drive-kind").value,
      catalogue = $("drive-catalogue").value;
    const force = [value("force-x") ?? 0, value("force-y") ?? 0],
      mass = value("mass");
    const on = $("drive-on").value,
      acts = force.some(Boolean);
    const load = given({
      force: acts && on === "body" ? force : null,
      forces: acts && on !== "body" ? [{ link: on, force }] : null,
      torque: value("torque"),
      masses: mass ? [{ link: on, mass }] : null,
      parts: $("drive-parts").checked || null,
    });
    const rows = catalogue === "own" ? (this.table ?? "") : catalogue;
    const sizes = catalogue === "" ? { retracted: value("retracted"), stroke: value("stroke") } : { catalogue: rows };
    const reach = value("reach"),
      box = mountingBox(),
      ends = kind === "actuator" ? givenEnds() : {};
    const wishes = {
      rotary: {},
      actuator: {
        ...sizes,
        ...ends,
        reach_max: reach,
        count: kind === "actuator" ? value("count") : null,
        ground_box: ends.pin ? null : box,
      },
      dyad: { time_ratio: value("ratio"), reach_max: reach, motor_box: box },
      toggle: { reach_max: reach, ground_box: box },
    };
    const catalogues = { tension: { catalogue: "tension_springs" }, gas: {}, compression: {}, torsion: {} };
    const question = { ...this.#about(), load };
    if (kind === "ideal") return { ...question, drives: [], springs: [given({ kind: "tension", ground_box: box })] };
    const springs = Object.keys(catalogues).filter((one) => kind === one || kind === "springs");
    if (springs.length)
      return {
        ...question,
        drives: [],
        springs: springs.map((one) => ({
          kind: one,
          ...catalogues[one],
          ...behaviour(),
          ...(box && one !== "torsion" ? { ground_box: box } : {}),
        })),
      };
    return {
      ...question,
      drives: (kind === "any" ? ["rotary", "actuator", "dyad"] : [kind]).map((one) => ({
        kind: one,
        ...given(wishes[one]),
      })),
    };
  }

  /** Asks what the fields say, or for a linkage that was moved `again` what was asked for the one before. */
  async #find(again = null) {
    if (!this.solution) return;
    this.control?.abort();
    const control = new AbortController(),
      by = again && this.drive?.byHand ? this.drive : null;
    this.control = control;
    this.#say(again ? "Looking again: what is shown is of the linkage before it was moved." : "Looking…");
    try {
      const request = again ? { ...this.#about(), ...again } : this.#request();
      this.pending = questionOf(request);
      const reply = await (await ask("/v2/drives", request, control.signal)).json();
      if (control.signal.aborted) return;
      this.kept.set(this.solution, reply);
      this.asked.set(reply, this.pending);
      const found = reply.drives.length + reply.springs.length,
        sort = request.springs ? "spring" : "drive";
      this.#use(reply, again && this.drive?.kind);
      if (by && this.drive?.kind === by.kind) {
        this.drive = { ...moved(by, fitOf(this.solution, this.answer.motion).linkage, reply.torque), from: this.drive };
        this.#list();
        this.#describe();
      }
      if (!again) this.board.reveal(this.board.driven());
      this.#say(
        [
          found ? "" : `No sensible ${sort}${reply.refused.length ? ", because of what is listed below" : ""}.`,
          ...reply.notes.map((one) => `${capital(one)}.`),
        ]
          .join(" ")
          .trim(),
        !found,
      );
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
    this.drive = this.options.find((one) => one.kind === kind) ?? this.options[0] ?? null;
    this.#list();
    this.#describe();
  }

  #list() {
    const { reply } = this,
      buttons = this.options.map((drive) => {
        const one = button("", () => {
            this.drive = drive;
            this.#list();
            this.#describe();
            this.board.reveal(this.board.driven());
          }),
          facts = document.createElement("dl");
        for (const [name, words] of factsOf(drive, this.answer.motion.unit, this.#newtons))
          facts.append(element("dt", "", name), element("dd", "", words));
        one.append(element("strong", "", nameOf(drive)), facts);
        one.setAttribute(
          "aria-pressed",
          String(drive === this.drive || (this.drive?.byHand && this.drive.from === drive)),
        );
        return one;
      });
    $("drive-found").replaceChildren(...buttons);
    $("drive-found").hidden = !buttons.length;
    const refused = reply?.refused ?? [];
    $("drive-reasons").hidden = !refused.length;
    $("drive-reasons").open = !buttons.length;
    $("drive-refused").replaceChildren(
      ...refused.map(({ kind, link, name, reason }) =>
        element(
          "li",
          "",
          `${KINDS[kind] ? `${KINDS[kind]} on the ${plain(link)}` : `${kind} spring, ${link}`}${name ? ` (${name})` : ""}: ${reason.replace("reach_max", "“pin within”")}.`,
        ),
      ),
    );
  }

  /** Rows [name, value] of what is shown: for the card and for the sheet. */
  rows() {
    const { drive } = this,
      unit = this.answer?.motion.unit ?? "";
    if (!drive) return [];
    const newtons = this.#newtons,
      number = (one, digits = 5) => text(one, digits),
      place = (pair) => `${pair.map((one) => number(one)).join(", ")} ${unit}`;
    const force = (one) => `${grouped(text(one, 4))}${newtons ? " N" : ""}`,
      torque = (one) => `${force(one)}${newtons ? `·${unit}` : ""}`;
    const units = newtons ? [] : [["forces, torques", `in the load’s unit, and that times ${unit}`]];
    if (drive.springs) {
      return [
        ...drive.springs.flatMap((one) => [
          [
            `${one.count > 1 ? `${one.count} × ` : ""}${one.kind} spring`,
            `${one.name ?? `${force(one.stiffness)} per ${unit}`}, ${one.between.join(" to ")}`,
          ],
          ...(one.kind === "torsion"
            ? [
                ["its joint", place(one.point)],
                [
                  "its twist",
                  `${number(one.twist[0], 4)} to ${number(one.twist[1], 4)}°, ${number(one.curve.twist[0], 4)}° at the first pose`,
                ],
              ]
            : [
                ["its ends", one.points.map(place).join(" and ")],
                ["its length", `${number(one.length[0])} to ${number(one.length[1])} ${unit}`],
              ]),
          [
            "torque left (rms)",
            `${torque(settled(one.torque.after.rms, one.torque.before.rms))} of ${torque(one.torque.before.rms)}`,
          ],
          ["by itself", one.motion_at_ends],
        ]),
        ...units,
      ];
    }
    const turns = driveTurns(this.solution),
      rows = [
        [
          "drive",
          `${drive.name ?? KINDS[drive.kind]} on the ${plain(drive.link)}${drive.count > 1 ? `, ${drive.count} side by side` : ""}${drive.byHand ? ", by hand" : ""}`,
        ],
      ];
    if (drive.motor) rows.push(["motor", place(drive.motor)]);
    if (drive.ground_point) rows.push(["ground point", place(drive.ground_point)]);
    if (drive.pin)
      rows.push(
        [`pin at ${itemOf(this.answer.motion)} 1`, place(drive.pin)],
        ["pin on the link", place(drive.pin_on_link)],
      );
    if (drive.retracted)
      rows.push([
        "retracted, stroke",
        `${number(drive.retracted)} + ${number(drive.stroke)} ${unit}, ${drive.extends ? "extends" : "retracts"}`,
      ]);
    if (drive.dead !== undefined && drive.dead !== null)
      rows.push(["dead point", `at ${number(drive.dead)}${turns ? "°" : ` ${unit}`}`]);
    if (drive.arm_min !== null && drive.arm_min !== undefined)
      rows.push(["least arm", `${number(drive.arm_min)} ${armUnit(unit, turns)}`]);
    if (Number.isFinite(drive.peak_force))
      rows.push([
        "peak force",
        `${force(drive.peak_force)}${drive.peak_force_ratio ? `, ${number(drive.peak_force_ratio, 4)} × the least there can be` : ""}`,
      ]);
    if (Number.isFinite(drive.peak_torque))
      rows.push([drive.kind === "toggle" ? "torque at the handle" : "peak torque", torque(drive.peak_torque)]);
    if (drive.holding)
      rows.push(["holding, first and last", drive.holding.map(drive.kind === "rotary" ? torque : force).join(", ")]);
    if (drive.buckling)
      rows.push([
        "buckling",
        drive.buckling.safety === null ? "never pushed" : `${number(drive.buckling.safety, 3)} times safe`,
      ]);
    if (drive.six_bar)
      rows.push(
        ["crank and rod", `${number(drive.six_bar.crank)}, ${number(drive.six_bar.coupler)} ${unit}`],
        ["time ratio", number(drive.six_bar.time_ratio, 4)],
        ["transmission of the rod", `${number(drive.six_bar.transmission_angle_min, 4)}° or more`],
      );
    if (drive.lock)
      rows.push(
        ["handle and strut", `${number(drive.lock.handle)}, ${number(drive.lock.strut)} ${unit}`],
        ["over centre", `${number(drive.lock.over_centre, 3)}° at the ${drive.lock.at} pose`],
      );
    rows.push(["stops", drive.stops], ["without power", drive.holds]);
    return (drive.peak_force ?? drive.peak_torque) ? [...rows, ...units] : rows;
  }

  /** Its parts at the first pose as lines, for the sheet. */
  lines() {
    const { drive } = this;
    if (!drive) return [];
    if (drive.springs) return drive.springs.map(({ points, point }) => points ?? [point]);
    if (drive.kind === "rotary") return [[drive.motor]];
    const { ground, knee, pin } = drive.curve,
      joints = this.solution.links ? fitOf(this.solution, this.answer.motion).at[0] : null;
    return [
      [ground[0], knee?.[0], pin[0]].filter(Boolean),
      ...(joints ? armsOf(drive, joints, ground[0], pin[0]) : []),
    ];
  }

  #describe() {
    $("drive-numbers").replaceChildren(...(this.drive ? [namedRows(this.rows())] : []));
    this.#curves();
    this.#draw();
  }

  /** Force, torque and arm over the way, the force beside the least peak that any cylinder of this stroke has. */
  #curves() {
    const host = $("drive-curves"),
      { drive, reply } = this;
    host.replaceChildren();
    this.charts = [];
    if (!drive || $("drive-card").hidden) return;
    const sense = this.player.shown?.pass.sense ?? 1,
      unit = this.answer.motion.unit,
      turns = driveTurns(this.solution),
      axis = turns ? { sense } : { sense, degreesX: false, xName: ` ${unit}` },
      plot = (title, x, series) => {
        const order = x.map((at, k) => [sense * at, k]).sort((a, b) => a[0] - b[0]);
        this.charts.push(
          titledChart(host, title, {
            x: order.map(([at]) => at),
            series: series.map((one) => ({ ...one, values: order.map(([, k]) => one.values[k]) })),
            height: 140,
            ...axis,
          }),
        );
      };
    const [newtons, moment] = this.#newtons ? [", N", `, N·${unit}`] : ["", ""];
    if (drive.springs) {
      const { curve } = drive.springs[0];
      plot(`Torque of the drive with the springs${moment} (dashed: without)`, curve.crank_angle, [
        { values: curve.torque, colour: "body" },
        { values: reply.torque.torque, colour: "muted", dash: [6, 4], width: 1.2 },
      ]);
      return;
    }
    const { curve, peak_force_bound: bound } = drive,
      level = (one) => ({ values: curve.crank_angle.map(() => one), colour: "box", dash: [6, 4], width: 1.2 });
    if (curve.force) {
      const amounts = curve.force.map(Math.abs);
      plot(
        `Force of the ${KINDS[drive.kind]}, push or pull${newtons}${bound ? " (dashed: no peak is below this)" : ""}`,
        curve.crank_angle,
        [{ values: amounts, colour: "body" }, ...(bound ? [level(bound)] : [])],
      );
    }
    if (curve.torque)
      plot(
        (drive.kind === "dyad"
          ? "Torque of the motor, forwards"
          : drive.kind === "toggle"
            ? "Torque at the handle"
            : "Torque") + moment,
        curve.crank_angle,
        [{ values: curve.torque, colour: "body" }],
      );
    if (curve.arm)
      plot(`Moment arm, ${armUnit(unit, turns)}`, curve.crank_angle, [
        { values: curve.arm.map(Math.abs), colour: "path" },
      ]);
    this.#mark();
  }

  #mark() {
    const travel = this.board.joints ? Number($("slider").value) : null;
    if (travel !== null) for (const one of this.charts) one.mark(travel);
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
    if (drive.springs) {
      for (const { curve, kind, point, between: links } of drive.springs) {
        if (kind === "torsion") {
          // a joint of two moving links is shown where it is at the first pose only by the numbers
          if (links.includes("ground")) this.#dot(point, "motor");
          continue;
        }
        const ends = between(
          curve,
          curve.ends.map((pair) => pair.flat()),
          at,
        );
        if (ends) this.#line(kind === "gas" ? "rod" : "spring", [ends.slice(0, 2), ends.slice(2)]);
      }
      return;
    }
    const { curve } = drive,
      [ground, pin, knee] = ["ground", "pin", "knee"].map((name) =>
        curve[name] ? between(curve, curve[name], at) : drive.motor,
      );
    if (drive.kind === "rotary") {
      this.#dot(drive.motor, "motor");
      return;
    }
    if (!ground || !pin) return;
    if (solution.links) for (const arm of armsOf(drive, joints, ground, pin)) this.#line("arm", arm);
    if (curve.knee && knee) {
      this.#line("rod", [ground, knee, pin]);
      for (const place of [ground, knee, pin]) this.#dot(place, "joint");
      return;
    }
    const length = Math.hypot(...less(pin, ground)),
      way = less(pin, ground).map((part) => part / length),
      body = 0.85 * drive.retracted,
      half = (WIDE / 2) * drive.retracted;
    const corner = (along, across) => [
      ground[0] + way[0] * along - way[1] * across,
      ground[1] + way[1] * along + way[0] * across,
    ];
    this.#line("rod", [ground, pin]);
    this.#line(
      "cylinder",
      [corner(0.04 * body, half), corner(body, half), corner(body, -half), corner(0.04 * body, -half)],
      true,
    );
    const free = drive.on === "ground" && Boolean(JOINTS[drive.link]) && Boolean(solution.links);
    this.#handle(ground, "ground", free);
    this.#handle(pin, "pin", free);
    put(layer, { "data-length": text(length, 6) });
  }

  #line(name, points, closed = false) {
    const { view } = this.board;
    make(
      "path",
      {
        class: `drive-${name}`,
        d: `M${points
          .map((place) =>
            view
              .at(place)
              .map((one) => one.toFixed(1))
              .join(" "),
          )
          .join("L")}${closed ? "Z" : ""}`,
      },
      this.board.driveLayer,
    );
  }

  #dot(place, name) {
    const [cx, cy] = this.board.view.at(place);
    return make("circle", { class: `drive-${name}`, cx, cy, r: name === "motor" ? 12 : 5 }, this.board.driveLayer);
  }

  /** An end of a cylinder, which drags and arrow keys move. */
  #handle(place, end, free) {
    const dot = this.#dot(place, "end");
    if (!free) return;
    put(dot, {
      r: HANDLE,
      tabindex: 0,
      role: "button",
      "data-end": end,
      "aria-label":
        end === "ground"
          ? "Ground point of the cylinder: drag, or arrow keys"
          : "Pin of the cylinder: drag, or arrow keys",
    });
    if (this.focused === end) dot.focus({ preventScroll: true });
    dot.addEventListener("keydown", (event) => {
      const by = this.board.nudge(event);
      if (!by) return;
      event.preventDefault();
      event.stopPropagation();
      this.#put(
        end,
        place.map((part, i) => part + by[i]),
      );
    });
    dot.addEventListener("pointerdown", (event) => {
      event.stopPropagation();
      this.player.stop();
      this.board.follow(
        event,
        (px, py) => this.#put(end, this.board.view.world(px, py)),
        () => {},
      );
    });
  }

  /** One end is put elsewhere by hand, where the crank stands now. */
  #put(end, place) {
    const { drive, board } = this,
      { at, angle } = board.joints.frames[drive.link],
      from = drive.from ?? drive;
    const ends = end === "ground" ? { ground_point: place } : { pin_on_link: turned(less(place, at), -angle) };
    this.drive = {
      ...moved({ ...drive, ...ends }, fitOf(this.solution, this.answer.motion).linkage, this.reply.torque),
      from,
    };
    this.#list();
    this.#describe();
  }
}
