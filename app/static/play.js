// A slider with Play: runs a value over its range at the screen's rate, there and back or round and round.

import { ICONS } from "./drawing.js";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];
const STEPS = 1000;

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
    block = document.createElement("div");
  block.className = "player";
  block.innerHTML = `<button type="button" class="round"><svg viewBox="0 0 20 20" aria-hidden="true"><path class="solid"/></svg></button>
    <label class="hidden" for="${id}"></label><input class="grow" type="range" id="${id}" step="any">
    <output for="${id}"></output><label>Speed <select></select></label>`;
  const [button, slider, output, speed] = ["button", "input", "output", "select"].map((part) =>
    block.querySelector(part),
  );
  block.querySelector("label").textContent = name;
  Object.assign(slider, { min: Math.min(from, to), max: Math.max(from, to), value: from });
  for (const factor of SPEEDS) speed.append(new Option(`${factor}×`, factor, factor === 1, factor === 1));
  host.append(block);
  let frame = null;

  const icon = (word) => {
    button.setAttribute("aria-label", word);
    button.querySelector("path").setAttribute("d", ICONS[word]);
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
    icon("Play");
  };
  const play = () => {
    icon("Pause");
    if (Number(slider.value) === to) go(from);
    let before = performance.now(),
      heading = Math.sign(to - from) || 1;
    const [low, high] = [Math.min(from, to), Math.max(from, to)];
    const step = (now) => {
      if (!block.isConnected) {
        stop();
        return;
      }
      frame = requestAnimationFrame(step);
      let value =
        Number(slider.value) + (heading * (now - before) * Number(speed.value) * (high - low)) / (1000 * seconds);
      before = now;
      if (round) value = low + ((((value - low) % (high - low)) + (high - low)) % (high - low));
      else if (value >= high) [value, heading] = [high, -1];
      else if (value <= low) [value, heading] = [low, 1];
      go(value);
    };
    frame = requestAnimationFrame(step);
  };
  button.addEventListener("click", () => (frame === null ? play() : stop()));
  slider.addEventListener("input", () => {
    stop();
    go(Number(slider.value));
  });
  // the keys of a slider whose step is "any" are the browser's choice: here a hundredth, and a tenth with Page
  slider.addEventListener("keydown", (event) => {
    const tenth = STEPS / 10,
      share = { ArrowRight: 10, ArrowUp: 10, ArrowLeft: -10, ArrowDown: -10, PageUp: tenth, PageDown: -tenth }[
        event.key
      ];
    if (!share) return;
    event.preventDefault();
    stop();
    go(Number(slider.value) + (share * (slider.max - slider.min)) / STEPS);
  });
  stop();
  go(from);
  return {
    go,
    stop,
    get value() {
      return Number(slider.value);
    },
  };
}
