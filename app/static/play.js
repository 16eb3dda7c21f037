// Playing: a slider runs over its range at the screen's rate, there and back or round and round.

import { ICONS, element, make, put } from "./drawing.js";
import { build } from "./shell.js";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];
const KEYS = { ArrowRight: 0.01, ArrowUp: 0.01, ArrowLeft: -0.01, ArrowDown: -0.01, PageUp: 0.1, PageDown: -0.1 };
const REST = 100; // milliseconds between two marks in the curves
const STOP_MS = 240; // rest at a stop, at most
const STOPS_MS = 1600; // rest at all stops of a pass together
const MOST_STOPS = 40;

let serial = 0;

/** `mark` with the latest value at most every `REST` milliseconds: curves are slower to draw than a mechanism. */
export function seldom(mark) {
  let due = null,
    latest;
  return (value) => {
    latest = value;
    due ??= setTimeout(() => {
      due = null;
      mark(latest);
    }, REST);
  };
}

/** A range input that Play runs; it stops by itself when it is taken off the page. */
export class Playback {
  stops = []; // values at which it rests for a moment
  #frame = null;

  /**
   * Binds a button `press`, a `slider` and a menu `speed`. `show(value)` is called at each move; a pass takes `seconds`
   * at speed 1, and where `isRound()` it starts again at the lower end instead of turning back.
   */
  constructor(controls, options) {
    Object.assign(this, controls, options);
    const { press, slider } = this;
    press.addEventListener("click", () => (this.runs ? this.stop() : this.run()));
    slider.addEventListener("input", () => this.put(this.value));
    // the keys of a slider whose step is "any" are the browser's choice: here a hundredth, and a tenth with Page
    slider.addEventListener("keydown", (event) => {
      const [low, high] = this.range,
        share = KEYS[event.key];
      if (!share) return;
      event.preventDefault();
      this.put(this.value + share * (high - low));
    });
    this.stop();
  }

  get runs() {
    return this.#frame !== null;
  }

  get value() {
    return Number(this.slider.value);
  }

  get range() {
    return [Number(this.slider.min), Number(this.slider.max)];
  }

  /** Values nearer than this are one: a slider of the page has no more steps. */
  get near() {
    const [low, high] = this.range;
    return 1e-6 * (high - low);
  }

  go(value) {
    this.slider.value = value;
    this.show(this.value);
  }

  /** Stops at a value. */
  put(value) {
    this.stop();
    this.go(value);
  }

  stop() {
    if (this.runs) cancelAnimationFrame(this.#frame);
    this.#frame = null;
    this.#showButton("Play");
  }

  #showButton(name) {
    this.press.setAttribute("aria-label", name);
    put(this.press.querySelector("path"), { d: ICONS[name] });
  }

  run() {
    let before = performance.now(),
      heading = 1,
      until = 0;
    this.stop();
    this.#showButton("Pause");
    if (!this.isRound() && this.value >= this.range[1]) this.slider.value = this.range[0];
    const step = (now) => {
      if (!this.slider.isConnected) {
        this.stop();
        return;
      }
      this.#frame = requestAnimationFrame(step);
      const { value: from, stops, near } = this,
        [low, high] = this.range,
        speed = Number(this.speed.value),
        elapsed = now - before;
      before = now;
      if (now < until) return;
      let value = from + (heading * elapsed * speed * (high - low)) / (1000 * this.seconds);
      const isPassed = (at) => heading * (at - from) > near && heading * (value - at) >= 0,
        stop = stops.length <= MOST_STOPS ? stops.find(isPassed) : undefined;
      if (stop !== undefined) {
        value = stop;
        until = now + Math.min(STOP_MS, STOPS_MS / stops.length) / speed;
      }
      if (this.isRound()) value = value >= high ? low + ((value - high) % (high - low)) : value;
      else if (value >= high) [value, heading] = [high, -1];
      else if (value <= low && heading < 0) [value, heading] = [low, 1];
      this.go(value);
    };
    this.#frame = requestAnimationFrame(step);
  }
}

/**
 * Adds a slider with Play to `host`. `show(value)` places what moves and returns the value in words; `name` is what
 * the slider runs over, from `from` to `to`, in `seconds` at speed 1; with `round` it starts again at `from`.
 */
export function player(host, { name, from, to, seconds, round = false, show }) {
  const id = `play-${++serial}`,
    icon = make("svg", { viewBox: "0 0 20 20", "aria-hidden": "true" }),
    press = build("button", { type: "button", className: "round" }, icon),
    slider = build("input", { id, className: "grow", type: "range", min: from, max: to, step: "any" }),
    output = build("output", { for: id }),
    options = SPEEDS.map((factor) => new Option(`${factor}×`, factor, factor === 1, factor === 1)),
    speed = build("select", {}, options),
    label = build("label", { className: "hidden", for: id }, name);
  make("path", { class: "solid" }, icon);
  slider.value = from;
  host.append(element("div", "player", press, label, slider, output, build("label", {}, "Speed ", speed)));
  const showWords = (value) => {
    const words = show(value);
    output.textContent = words;
    slider.setAttribute("aria-valuetext", words);
  };
  const playback = new Playback({ press, slider, speed }, { seconds, isRound: () => round, show: showWords });
  playback.go(from);
  return playback;
}
