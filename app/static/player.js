// Moves the selected linkage over the crank angle and plots its curves over that angle.

import { redrawOn, titledChart } from "./charts.js";
import { Linkage } from "./kinematics.js";
import { travels } from "./motion.js";
import { $ } from "./shell.js";

const RAD = Math.PI / 180;
const CURVE_STEPS = 240;
const RANGE_MS = 4000; // time of one pass over the range at speed 1
const PLAY = "M6 3.5v13l11-6.5z", PAUSE = "M5.5 3.5h3v13h-3zM11.5 3.5h3v13h-3z";

const wholeTurn = () => $("range").value === "turn";

function setButton(name, icon) {
  $("play").setAttribute("aria-label", name);
  $("play").querySelector("path").setAttribute("d", icon);
}

/** What canvas and curves need of a solution: joints over the interval and the turn, joints and errors at the poses. */
function trajectory(solution, motion) {
  const linkage = new Linkage(solution);
  const span = motion.direction * motion.span * RAD;
  const steps = Math.min(1440, Math.max(180, Math.ceil(motion.span)));
  const angles = travels(motion).map((t) => motion.direction * t * RAD);
  const at = angles.map((t) => linkage.at(t));
  return {
    linkage, motion, span, angles, at,
    used: linkage.over(0, span, steps),
    turn: linkage.turnsFully ? linkage.over(0, motion.direction * 2 * Math.PI, 360) : null,
    errors: linkage.mount && motion.wanted !== "rotation"
      ? motion.poses.map((pose, k) => [[pose.x, pose.y], at[k]?.p ?? [pose.x, pose.y]]) : null,
  };
}

export class Player {
  constructor(board) {
    Object.assign(this, { board, shown: null, frame: null, charts: [] });
    $("slider").addEventListener("input", () => { this.#pause(); this.#showTravel(); });
    $("range").addEventListener("change", () => { this.#setRange(); this.#drawCurves(); });
    $("play").addEventListener("click", () => (this.frame === null ? this.#play() : this.#pause()));
    redrawOn($("curves"), () => this.#drawCurves());
  }

  /** Shows a solution of a motion; a run that is playing goes on. */
  show(solution, motion) {
    this.shown = trajectory(solution, motion);
    $("range").querySelector("[value=turn]").disabled = !this.shown.turn;
    if (!this.shown.turn) $("range").value = "used";
    this.board.showLinkage(this.shown);
    this.board.fit();
    this.#setRange();
    this.#drawCurves();
  }

  clear() {
    this.shown = null;
    this.#pause();
    this.board.showLinkage(null);
  }

  #setRange() {
    const slider = $("slider");
    const last = wholeTurn() ? 360 : Math.abs(this.shown.span) / RAD;
    slider.max = last;
    if (Number(slider.value) > last) slider.value = 0;
    this.#showTravel();
  }

  #showTravel() {
    if (!this.shown) return;
    const travel = Number($("slider").value);
    const degrees = Math.sign(this.shown.span) * travel;
    $("travel").value = `${degrees.toFixed(1)}°`;
    $("slider").setAttribute("aria-valuetext", `crank turned by ${degrees.toFixed(1)} degrees`);
    this.board.showJoints(this.shown.linkage.at(degrees * RAD));
    for (const one of this.charts) one.mark(travel);
  }

  #play() {
    if (!this.shown) return;
    const slider = $("slider");
    if (!wholeTurn() && Number(slider.value) >= Number(slider.max)) slider.value = 0;
    setButton("Pause", PAUSE);
    let before = performance.now(), heading = 1;
    const step = (now) => {
      const max = Number(slider.max);
      let value = Number(slider.value) + (heading * (now - before) * Number($("speed").value) * max) / RANGE_MS;
      before = now;
      // an interval is run back and forth, a whole turn always forwards
      if (wholeTurn()) value %= max;
      else if (value >= max) [value, heading] = [max, -1];
      else if (value <= 0 && heading < 0) [value, heading] = [0, 1];
      slider.value = value;
      this.#showTravel();
      this.frame = requestAnimationFrame(step);
    };
    this.frame = requestAnimationFrame(step);
  }

  #pause() {
    if (this.frame !== null) cancelAnimationFrame(this.frame);
    this.frame = null;
    setButton("Play", PLAY);
  }

  #drawCurves() {
    if (!this.shown || $("curves-card").hidden) return;
    const { linkage, motion, span, angles, at, errors } = this.shown;
    const last = wholeTurn() ? Math.sign(span) * 2 * Math.PI : span;
    const even = Array.from({ length: CURVE_STEPS + 1 }, (_, k) => (last * k) / CURVE_STEPS);
    const inside = angles.filter((t) => Math.abs(t) <= Math.abs(last) * (1 + 1e-12));
    const all = [...new Set([...even, ...inside])].sort((a, b) => Math.abs(a) - Math.abs(b));
    const joints = all.map((t) => linkage.at(t));
    const poseAt = new Map(angles.map((t, k) => [t, k]));
    const atPoses = (value) => all.map((t) => (poseAt.has(t) ? value(poseAt.get(t)) : null));
    const over = (value) => joints.map((j) => (j ? value(j) : null));
    const x = all.map((t) => Math.abs(t) / RAD); // a clockwise crank, too, is plotted from left to right
    const host = $("curves");
    host.replaceChildren();
    const add = (title, series, more) => titledChart(host, title, { x, series, ...more });

    const rotation = [{ values: over((j) => j.rotation / RAD), colour: "body" }];
    if (motion.wanted !== "position") rotation.push({ values: atPoses((k) => motion.poses[k].angle), colour: "pose", points: true });
    this.charts = [add(motion.wanted === "position" ? "Rotation of the coupler, degrees" : "Rotation of the body, degrees (dots: wanted)", rotation, { degreesY: true, height: 160 })];

    const errorDots = (value) => ({ values: atPoses(value), colour: "bad", points: true });
    if (errors) {
      const distances = errors.map(([from, to]) => Math.hypot(to[0] - from[0], to[1] - from[1]));
      this.charts.push(add("Position error at the poses", [errorDots((k) => distances[k]), { values: over(() => 0), colour: "line" }]));
    } else if (motion.wanted === "rotation") {
      const differences = at.map((j, k) => (j ? motion.poses[k].angle - j.rotation / RAD : 0));
      this.charts.push(add("Rotation error at the poses, degrees", [errorDots((k) => differences[k])]));
    }

    const transmission = [{ values: over((j) => j.transmission / RAD), colour: "path" }];
    const least = motion.limits.transmission;
    if (least) transmission.push({ values: x.map(() => least), colour: "box", dash: [6, 4], width: 1.2 });
    this.charts.push(add(`Transmission angle, degrees${least ? " (dashed: limit)" : ""}`, transmission, { height: 160, degreesY: true, range: [0, 90], splits: [0, 30, 60, 90] }));
    for (const one of this.charts) one.mark(Number($("slider").value));
  }
}
