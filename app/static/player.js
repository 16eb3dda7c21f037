// Moves the selected linkage over the crank angle, past marks at the samples, and plots its curves over that angle.

import { Charts } from "./charts.js";
import { make, text } from "./drawing.js";
import { fitOf, settled } from "./fit.js";
import { PRESET, itemOf, placeOf, wantsAngles } from "./motion.js";
import { reading } from "./law.js";
import { RAD } from "./plane.js";
import { Playback } from "./play.js";
import { $, listen } from "./shell.js";
import { analysisCurves, band } from "./studies.js";
import { driveName, marksWithin } from "./timing.js";

const CURVE_STEPS = 240;
const COARSE = 60; // steps of a path while the linkage is moved
const RANGE_SECONDS = 4; // time of one pass over the range at speed 1
const THUMB = 8; // pixels from the slider's ends to the middle of its knob there

const wholeTurn = () => $("range").value === "turn";

/** Return the data for canvas and curves: joints over the interval and the turn, and errors at the samples. */
export function trajectory(solution, motion, coarse = false) {
  const fit = fitOf(solution, motion),
    { linkage, pass } = fit,
    { sense, low, high } = pass;
  const steps = coarse ? COARSE : pass.turns ? Math.min(1440, Math.max(180, Math.ceil(high - low))) : 180;
  return {
    ...fit,
    motion,
    solution,
    band: band(solution, linkage),
    used: linkage.over(sense * low * RAD, sense * high * RAD, steps),
    turn: linkage.turnsFully ? linkage.over(0, sense * 2 * Math.PI, coarse ? COARSE : 360) : null,
    errors:
      fit.worst.place === null
        ? null
        : motion.poses.map((pose, k) => (fit.places[k] === null ? null : [placeOf(pose), fit.at[k].p])),
  };
}

export class Player {
  shown = null;
  width = 0; // of the marks below the slider; reading it from the page would force a layout
  marks = []; // the travel at which each sample is passed
  stops = []; // the samples in the order in which they are passed

  constructor(board) {
    this.board = board;
    this.playback = new Playback(
      { press: $("play"), slider: $("slider"), speed: $("speed") },
      { seconds: RANGE_SECONDS, isRound: wholeTurn, show: () => this.#showTravel() },
    );
    listen("range", "change", () => {
      this.#setRange();
      this.drawCurves();
    });
    listen("before", "click", () => this.#step(-1));
    listen("after", "click", () => this.#step(1));
    new ResizeObserver(([{ contentRect }]) => {
      this.width = contentRect.width;
      this.#drawMarks();
    }).observe($("marks"));
    this.charts = new Charts($("curves"), () => this.#curves());
  }

  /** Shows a solution of a motion; a run that is playing goes on. The view stays unless `fit` says otherwise. */
  show(solution, motion, fit = false, curves = true) {
    this.shown = trajectory(solution, motion);
    $("range").querySelector("[value=turn]").disabled = !this.shown.turn;
    if (!this.shown.turn) $("range").value = "used";
    $("before").ariaLabel = $("before").title = `Previous ${itemOf(motion)}`;
    $("after").ariaLabel = $("after").title = `Next ${itemOf(motion)}`;
    this.board.showLinkage(this.shown);
    if (fit) this.board.fit();
    this.#setRange();
    if (curves) this.drawCurves();
  }

  /** Puts a linkage that is being moved on the board, at sample k or else where its drive is, without drawing it. */
  track(solution, motion, k) {
    const { travel, shown: before } = this,
      shown = trajectory(solution, motion, true),
      { low, high, sense } = shown.pass;
    this.stop();
    this.shown = { ...shown, band: null };
    const { pass } = before ?? shown,
      share = (pass.sense * travel - pass.low) / (pass.high - pass.low || 1),
      joints = shown.at[k] ?? shown.linkage.at(sense * (low + share * (high - low)) * RAD);
    Object.assign(this.board, { linkage: this.shown, joints });
  }

  /** Position of the slider, in degrees of crank from the first sample, with sign. */
  get travel() {
    return this.shown ? this.shown.pass.sense * Number($("slider").value) : 0;
  }

  /** The share of the used interval at which the slider stands, from 0 to 1. */
  get share() {
    if (!this.shown) return 0;
    const { low, high } = this.shown.pass;
    return Math.min(1, Math.max(0, (Number($("slider").value) - low) / (high - low || 1)));
  }

  /** Lets the shown linkage run, unless the reader's system asks for little motion. */
  run() {
    if (!this.playback.runs && !matchMedia("(prefers-reduced-motion: reduce)").matches) this.playback.run();
  }

  /** Lets the shown linkage run from the start of the slider. */
  restart() {
    this.playback.put(this.playback.range[0]);
    this.playback.run();
  }

  stop() {
    this.playback.stop();
  }

  /** Moves to a crank angle from the first sample, with sign. */
  goto(degrees) {
    const slider = $("slider"),
      travel = this.shown.pass.sense * degrees;
    slider.min = Math.min(Number(slider.min), travel);
    slider.max = Math.max(Number(slider.max), travel);
    this.playback.go(travel);
  }

  clear() {
    this.shown = null;
    this.stop();
    this.board.showLinkage(null);
  }

  /** The travels that the slider runs over. */
  get #range() {
    return wholeTurn() ? [0, 360] : [this.shown.pass.low, this.shown.pass.high];
  }

  #setRange() {
    const slider = $("slider"),
      [low, high] = this.#range;
    slider.min = low;
    slider.max = high;
    if (Number(slider.value) > high || Number(slider.value) < low) slider.value = Math.max(0, low);
    this.marks = marksWithin(this.shown.pass, low, high);
    const stops = this.marks.map((travel, k) => ({ travel, k })).filter(({ travel }) => travel !== null);
    this.stops = stops.sort((a, b) => a.travel - b.travel);
    this.playback.stops = this.stops.map(({ travel }) => travel);
    this.#drawMarks();
    this.#showTravel();
  }

  /** A line below the slider for each sample, with its number where there is room. */
  #drawMarks() {
    const svg = $("marks"),
      { width } = this;
    svg.replaceChildren();
    if (!this.shown || !width) return;
    const [low, high] = this.#range,
      middle = (travel) => THUMB + ((travel - low) / (high - low || 1)) * (width - 2 * THUMB);
    let end = -Infinity;
    for (const { travel, k } of this.stops) {
      const x = middle(travel),
        name = String(k + 1),
        half = 4 + 3.5 * name.length;
      make("path", { class: "mark", d: `M${x.toFixed(1)} 0v5`, "data-sample": k + 1 }, svg);
      if (x - half < end) continue;
      end = x + half;
      make("text", { x: x.toFixed(1), y: 16, "text-anchor": "middle", text: name }, svg);
    }
  }

  /** To the next sample, or with -1 to the one before. */
  #step(heading) {
    if (!this.shown) return;
    const { value, near } = this.playback,
      ahead = this.playback.stops.filter((travel) => heading * (travel - value) > near),
      [first] = this.playback.stops,
      last = this.playback.stops.at(-1),
      next = heading > 0 ? (ahead[0] ?? first) : (ahead.at(-1) ?? last);
    if (next !== undefined) this.playback.put(next);
  }

  #showTravel() {
    if (!this.shown) return;
    const travel = Number($("slider").value),
      { solution, motion, pass } = this.shown,
      degrees = pass.sense * travel,
      rounded = degrees.toFixed(1).replace(/^-0\.0$/, "0.0"),
      length = `${text(settled(degrees, pass.high - pass.low), 4)} ${motion.unit}`,
      passed = this.stops.filter((stop) => Math.abs(stop.travel - travel) < this.playback.near).map(({ k }) => k + 1),
      passedPoses = passed.length ? `${itemOf(motion)} ${passed.join(", ")}` : "";
    $("travel").value = pass.turns ? `${rounded}°` : length;
    $("at-sample").textContent = solution.output ? reading(solution, degrees, motion.unit) : passedPoses;
    const moves = pass.turns ? `turned by ${rounded} degrees` : `moved by ${length}`;
    $("slider").setAttribute(
      "aria-valuetext",
      `${driveName(solution)} ${moves}${passedPoses && `, at ${passedPoses}`}`,
    );
    this.board.showJoints(this.shown.linkage.at(degrees * RAD));
    this.charts.mark(travel);
  }

  drawCurves() {
    this.charts.draw();
  }

  /** Charts over the range of the slider: rotation, errors at the samples, transmission angle, and an analysis. */
  #curves() {
    if (!this.shown) return [];
    const { linkage, motion, places, turns: miss, worst, solution, pass } = this.shown,
      { sense, turns: angles } = pass,
      [low, high] = this.#range,
      { unit, limits } = motion,
      turns = wantsAngles(motion),
      item = itemOf(motion),
      list = [];
    const even = Array.from({ length: CURVE_STEPS + 1 }, (_, k) => low + ((high - low) * k) / CURVE_STEPS),
      // travels in the crank's sense: a clockwise crank, too, is plotted from left to right
      x = [...new Set([...even, ...this.stops.map(({ travel }) => travel)])].sort((a, b) => a - b),
      joints = x.map((travel) => linkage.at(sense * travel * RAD)),
      poseAt = new Map(this.stops.map(({ travel, k }) => [travel, k])),
      over = (value) => joints.map((j) => (j ? value(j) : null)),
      axis = angles ? { sense } : { sense, degreesX: false, xName: ` ${unit}` };
    const add = (title, series, more) => list.push([title, { x, series, ...axis, ...more }]),
      dots = (value, colour) => {
        const values = x.map((travel) => (poseAt.has(travel) ? value(poseAt.get(travel)) : null));
        return { values, colour, points: true };
      };
    $("curves-over").textContent = `Curves over the ${driveName(solution)}`;

    // wanted angles are drawn beside the curve, whole turns away where they do not count
    const target = (k) => {
      const j = joints[x.indexOf(this.marks[k])];
      return miss[k] === null || !j ? null : j.rotation / RAD - miss[k];
    };
    const rotation = [{ values: over((j) => j.rotation / RAD), colour: "body" }],
      degrees = { degreesY: true, height: 160 },
      zero = { values: over(() => 0), colour: "line" };
    if (turns) rotation.push(dots(target, "pose"));
    add(`Rotation of the ${turns ? "body, degrees (dots: required)" : "coupler, degrees"}`, rotation, degrees);
    if (worst.place !== null) add(`Position error at the ${item}s, ${unit}`, [dots((k) => places[k], "bad"), zero]);
    if (turns)
      add(`Rotation error (actual minus required) at the ${item}s, degrees`, [dots((k) => miss[k], "bad"), zero]);

    const transmission = [{ values: over((j) => j.transmission / RAD), colour: "path" }],
      minAngle = limits.kept.use ? (limits.transmission ?? PRESET.use) : null,
      scale = { range: [0, 90], splits: [0, 30, 60, 90] };
    if (minAngle) transmission.push({ values: x.map(() => minAngle), colour: "box", dash: [6, 4], width: 1.2 });
    add(`Transmission angle, degrees${minAngle ? " (dashed: limit)" : ""}`, transmission, { ...degrees, ...scale });
    // an analysis is over the used interval: over a whole turn its curves have gaps
    for (const { title, x: own, values } of analysisCurves(solution, sense, unit)) {
      const before = low < own[0] ? [low] : [],
        after = high > own.at(-1) ? [high] : [],
        padded = [...before.map(() => null), ...values, ...after.map(() => null)];
      add(title, [{ values: padded, colour: "body" }], { x: [...before, ...own, ...after] });
    }
    return list;
  }
}
