// A slider with Play: runs a value over its range at the screen's rate, there and back or round and round.

import { ICONS, element, make, put } from "./drawing.js";
import { build } from "./shell.js";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];
const KEYS = { ArrowRight: 0.01, ArrowUp: 0.01, ArrowLeft: -0.01, ArrowDown: -0.01, PageUp: 0.1, PageDown: -0.1 };

const REST = 100; // milliseconds between two marks in the curves

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

/**
 * Adds a slider with Play to `host`. `show(value)` places what moves and returns the value in words; `name` is what
 * the slider runs over, from `from` to `to`, in `seconds` at speed 1. `round`: starts again at `from`, else it turns
 * back. Returns {go(value), value, stop()}; it stops by itself when it is taken off the page.
 */
export function player(host, { name, from, to, seconds = 4, round = false, show }) {
  const id = `play-${++serial}`,
    icon = make("svg", { viewBox: "0 0 20 20", "aria-hidden": "true" }),
    shape = make("path", { class: "solid" }, icon),
    press = build("button", { type: "button", className: "round" }, icon),
    [low, high] = [Math.min(from, to), Math.max(from, to)],
    slider = build("input", { id, className: "grow", type: "range", min: low, max: high, step: "any" }),
    output = build("output", { for: id }),
    options = SPEEDS.map((factor) => new Option(`${factor}×`, factor, factor === 1, factor === 1)),
    speed = build("select", {}, options),
    label = build("label", { className: "hidden", for: id }, name),
    block = element("div", "player", press, label, slider, output, build("label", {}, "Speed ", speed));
  slider.value = from;
  host.append(block);
  let frame = null;

  const showIcon = (word) => {
    press.setAttribute("aria-label", word);
    put(shape, { d: ICONS[word] });
  };
  const go = (value) => {
    slider.value = value;
    const words = show(Number(slider.value));
    output.textContent = words;
    slider.setAttribute("aria-valuetext", words);
  };
  const stop = () => {
    if (frame !== null) cancelAnimationFrame(frame);
    frame = null;
    showIcon("Play");
  };
  const play = () => {
    showIcon("Pause");
    if (Number(slider.value) === to) go(from);
    let before = performance.now(),
      heading = Math.sign(to - from) || 1;
    const step = (now) => {
      if (!block.isConnected) {
        stop();
        return;
      }
      frame = requestAnimationFrame(step);
      const progress = (heading * (now - before) * Number(speed.value)) / (1000 * seconds);
      let value = Number(slider.value) + progress * (high - low);
      before = now;
      if (round) value = low + ((((value - low) % (high - low)) + (high - low)) % (high - low));
      else if (value >= high) [value, heading] = [high, -1];
      else if (value <= low) [value, heading] = [low, 1];
      go(value);
    };
    frame = requestAnimationFrame(step);
  };
  press.onclick = () => (frame === null ? play() : stop());
  slider.oninput = () => {
    stop();
    go(Number(slider.value));
  };
  // the keys of a slider whose step is "any" are the browser's choice: here a hundredth, and a tenth with Page
  slider.onkeydown = (event) => {
    const share = KEYS[event.key];
    if (!share) return;
    event.preventDefault();
    stop();
    go(Number(slider.value) + share * (high - low));
  };
  stop();
  go(from);
  return Object.defineProperty({ go, stop }, "value", { get: () => Number(slider.value) });
}
