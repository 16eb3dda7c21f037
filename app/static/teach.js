// Tools for lessons: velocity arrows and instant centres on the canvas, the canvas in full screen, and a film of it.

import { make } from "./drawing.js";
import { add, cross, dot, less, size, times } from "./plane.js";
import { download } from "./service.js";
import { $, listen } from "./shell.js";

const STEP = 1e-4; // of the drive, in radians or thousandths of a length, over which velocities are differences
const LONGEST = 90; // pixels of the longest arrow over the used interval
const FILM_MS = 12_000; // longest film
const FRAMES = 30; // a second

const across = ([x, y]) => [-y, x];

/** Velocities of moving joints per unit of the drive, and the angular velocity of the body; null at a dead position. */
function velocities(linkage, { travel }) {
  const [before, after] = [-STEP, STEP].map((step) => linkage.at(travel + step));
  if (!before || !after) return null;
  const rate = (later, earlier) => times(less(later, earlier), 1 / (2 * STEP));
  const of = Object.fromEntries(
    ["d", "c", "p"].flatMap((name) => (after[name] ? [[name, rate(after[name], before[name])]] : [])),
  );
  return { of, turning: (after.coupler - before.coupler) / (2 * STEP) };
}

/** The point in which two lines through points meet; null for parallel lines. */
function crossing([a, b], [c, d]) {
  const first = less(b, a),
    second = less(d, c),
    area = cross(first, second);
  if (Math.abs(area) < 1e-9 * size(first) * size(second)) return null;
  return add(a, times(first, cross(less(c, a), second) / area));
}

/** The layer of arrows and centres below the joints. */
class Lesson {
  constructor(board) {
    this.board = board;
    this.layer = make("g", { class: "lesson", "aria-hidden": "true" });
    board.svg.insertBefore(this.layer, board.posesLayer);
  }

  /** Pixels per unit of speed, so that the fastest joint of the used interval has the longest arrow. */
  #scale(shown) {
    if (this.shown === shown) return this.scale;
    const speeds = shown.used
      .filter((joints, k) => joints && k % 6 === 0)
      .flatMap((joints) => Object.values(velocities(shown.linkage, joints)?.of ?? {}).map(size));
    Object.assign(this, { shown, scale: LONGEST / Math.max(1e-300, ...speeds) });
    return this.scale;
  }

  draw() {
    const { board, layer } = this,
      { joints, linkage: shown, view } = board,
      isOn = $("arrows").checked || $("centres").checked;
    layer.replaceChildren();
    const found = isOn && shown && joints && velocities(shown.linkage, joints);
    if (!found) return;
    if ($("centres").checked) this.#centres(joints, found, view);
    if (!$("arrows").checked) return;
    const scale = this.#scale(shown);
    for (const [name, velocity] of Object.entries(found.of)) {
      const [x, y] = view.at(joints[name]),
        [u, v] = times(velocity, scale),
        length = Math.hypot(u, v);
      if (length < 3) continue;
      const [a, b] = [u / length, -v / length],
        [tipX, tipY] = [x + u, y - v],
        wing = (side) => `${tipX - 9 * a + side * 4 * b} ${tipY - 9 * b - side * 4 * a}`;
      make("path", { class: "arrow", d: `M${x} ${y}L${tipX} ${tipY}` }, layer);
      make("path", { class: "arrow tip", d: `M${tipX} ${tipY}L${wing(1)}L${wing(-1)}Z` }, layer);
    }
  }

  /** The instant centre of the body, with its lines to both pins, and of two cranks that of one against the other. */
  #centres({ a, b, c, d, links }, { of, turning }, view) {
    const scale = Math.max(size(of.d ?? [0, 0]), size(of.c ?? [0, 0]));
    const from =
        of.d && Math.abs(turning) * size(less(c, d)) > 1e-6 * scale ? add(d, times(across(of.d), 1 / turning)) : null,
      between = links.every(Boolean) ? crossing([a, b], [d, c]) : null;
    const draw = (point, name, ends) => {
      const [x, y] = view.at(point);
      for (const end of ends) make("path", { class: "ray", d: `M${view.at(end).join(" ")}L${x} ${y}` }, this.layer);
      make("circle", { class: "centre", cx: x, cy: y, r: 5 }, this.layer);
      const side = x > view.width / 2 ? -9 : 9, // towards the middle of the canvas
        at = { x: x + side, y: y - 8, "text-anchor": side < 0 ? "end" : "start" };
      make("text", { class: "joint-name", ...at }, this.layer).textContent = name;
    };
    if (from)
      draw(
        from,
        "centre of body and ground",
        [d, c].filter((pin, k) => [of.d, of.c][k] && size(less(pin, from)) > 0),
      );
    if (between && dot(less(between, a), less(between, a)) < 1e8 * dot(less(b, a), less(b, a)))
      draw(between, "centre of crank and rocker", [between === a ? b : a, d]);
  }
}

/** Paints the shapes of an SVG into a canvas of the same size, in the colours of the page. */
function paint(svg, canvas) {
  const pen = canvas.getContext("2d"),
    ratio = canvas.width / svg.clientWidth;
  pen.setTransform(1, 0, 0, 1, 0, 0);
  pen.fillStyle = getComputedStyle(svg.closest(".board")).backgroundColor;
  pen.fillRect(0, 0, canvas.width, canvas.height);
  for (const shape of svg.querySelectorAll("path, circle, rect, text")) {
    const style = getComputedStyle(shape);
    if (style.visibility === "hidden" || style.display === "none") continue;
    let opacity = 1;
    for (let part = shape; part !== svg; part = part.parentNode) opacity *= Number(getComputedStyle(part).opacity);
    const { a, b, c, d, e, f } = shape.getCTM(),
      number = (name) => Number(shape.getAttribute(name) ?? 0);
    pen.setTransform(ratio * a, ratio * b, ratio * c, ratio * d, ratio * e, ratio * f);
    Object.assign(pen, {
      lineWidth: parseFloat(style.strokeWidth),
      lineCap: style.strokeLinecap,
      lineJoin: style.strokeLinejoin,
    });
    pen.setLineDash(style.strokeDasharray === "none" ? [] : style.strokeDasharray.split(/[ ,]+/).map(parseFloat));
    const draw = (kind, colour, share, act) => {
      if (colour === "none") return;
      pen.globalAlpha = opacity * Number(share);
      pen[`${kind}Style`] = colour;
      act();
    };
    if (shape.matches("text")) {
      pen.font = `${style.fontWeight} ${style.fontSize} ${style.fontFamily}`;
      pen.textAlign = { middle: "center", end: "right" }[style.textAnchor] ?? "left";
      draw("fill", style.fill, style.fillOpacity, () => pen.fillText(shape.textContent, number("x"), number("y")));
      continue;
    }
    const path = new Path2D(shape.getAttribute("d") ?? "");
    if (shape.matches("circle")) path.arc(number("cx"), number("cy"), parseFloat(style.r), 0, 2 * Math.PI);
    if (shape.matches("rect")) path.rect(number("x"), number("y"), number("width"), number("height"));
    draw("fill", style.fill, style.fillOpacity, () => pen.fill(path));
    draw("stroke", style.stroke, style.strokeOpacity, () => pen.stroke(path));
  }
}

/** Records the canvas while the linkage runs, until the button is pressed again. */
class Film {
  constructor(board, player) {
    Object.assign(this, { board, player, recorder: null });
  }

  toggle() {
    if (this.recorder) this.recorder.stop();
    else this.#start();
  }

  /** Adds what the canvas shows as a frame. */
  frame() {
    if (this.recorder) paint(this.board.svg, this.canvas);
  }

  #start() {
    const { svg } = this.board,
      canvas = Object.assign(document.createElement("canvas"), {
        width: 2 * svg.clientWidth,
        height: 2 * svg.clientHeight,
      }),
      type = MediaRecorder.isTypeSupported("video/webm") ? "video/webm" : "video/mp4",
      parts = [];
    paint(svg, canvas);
    const recorder = new MediaRecorder(canvas.captureStream(FRAMES), { mimeType: type, videoBitsPerSecond: 6e6 }),
      timer = setTimeout(() => recorder.stop(), FILM_MS);
    Object.assign(this, { canvas, recorder });
    recorder.addEventListener("dataavailable", ({ data }) => parts.push(data));
    recorder.addEventListener("stop", () => {
      clearTimeout(timer);
      this.recorder = null;
      this.player.stop();
      $("record").textContent = "Record a film";
      download(new Blob(parts, { type }), `linkage.${type.slice(6)}`);
    });
    recorder.start();
    this.player.restart();
    $("record").textContent = "Stop and save";
  }
}

/** Binds the tools for lessons in the panel of the canvas. */
export function startTeaching(board, player) {
  const lesson = new Lesson(board),
    film = new Film(board, player);
  board.seen.push(
    () => lesson.draw(),
    () => film.frame(),
  );
  for (const name of ["arrows", "centres"]) listen(name, "change", () => lesson.draw());
  listen("record", "click", () => film.toggle());
  $("record").hidden = typeof MediaRecorder === "undefined";
  $("full-screen").hidden = !document.fullscreenEnabled;
  listen("full-screen", "click", () =>
    document.fullscreenElement ? document.exitFullscreen() : board.svg.closest(".board").requestFullscreen(),
  );
  document.addEventListener("fullscreenchange", () => {
    $("full-screen").textContent = document.fullscreenElement ? "Leave full screen" : "Full screen";
  });
}
