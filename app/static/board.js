// The canvas of the motion editor: what pointer and keys do on it, and the layers that are drawn.

import { LinkageShape, View, drawGrid, make, pathData, put } from "./drawing.js";
import { itemOf, placeOf, placesOf, wantsAngles, wantsPlaces } from "./motion.js";
import { PATH_POINTS, Pen } from "./pen.js";
import { RAD, add, less, turned } from "./plane.js";
import { Poses } from "./poses.js";
import { drawBody, drawBox, drawCurves, drawGhosts, drawOverlay, drawWay } from "./scenery.js";

const LAYERS = "grid box way overlay ghosts curves plates targets linkage body drive poses pen".split(" ");
const CLICK = 4; // pixels: a press that moves less is a click
const EMPTY = (item, law) => ({
  move: law ? "Choose or draw a function, then press Solve" : `No ${item}s yet: draw a path or add ${item}s`,
  add: `Click where the first ${item} should be`,
  path: "Draw a path here",
  box: "Drag a box for both fixed pivots",
  hand: "",
  outline: "Click the corners of the body",
});
const MOVE = "drag the ground to move the view. Keys: arrows move,";
const HELP = (item, turns) => ({
  move:
    `Drag a ${item}${turns ? ", or the end of its arm to turn it" : ""}; ${MOVE} ${turns ? "[ and ] turn, " : ""}` +
    "Page Up and Down select, Enter adds one, Delete removes.",
  add:
    `Click where the next ${item} should be; drag one to move it. ` +
    `Keys: Add a ${item}, then arrows move it, and Enter adds the next.`,
  path:
    `Drag along the path that a point of the body should follow: it becomes at most ${PATH_POINTS} points of a new ` +
    "motion. Or click point after point. Keys: Path, then Add a point, arrows and Enter.",
  box: "Drag a box that must contain both fixed pivots; drag its corners to change it, or type it under Limits.",
  hand:
    "Drag a joint of the selected linkage, or type its coordinates, and watch the error change. " +
    "Keys: Tab selects a joint, arrows move it.",
  outline:
    `Click the corners of the body at its selected ${item}; ` +
    "Enter, or a click on the first corner, closes the outline.",
});
const SMALL = 1e-9;

/**
 * Changes the motion only through `actions`: `edit(change, kind)`, `settle()` at the end of a drag, `choose(k)`,
 * `add(at)`, `remove(k)`, `draw(places, closed)` for a path drawn by hand, `hand(joint, place)` for a joint of the
 * linkage, `pivot(joint, place)` for a fixed pivot that the rest of it follows. `stale`: the linkage belongs to an
 * earlier motion. `held`: a pointer drags. `moved`: the user has moved or zoomed the view since it was fitted.
 */
export class Board {
  view = new View(600, 400);
  motion = null;
  linkage = null;
  joints = null;
  chosen = 0;
  fitted = false;
  moved = false;
  stale = false;
  held = false;
  ghosts = false;
  snap = false;
  others = [];
  corners = [];
  redrawn = []; // called after each drawing
  seen = []; // called after the linkage has moved

  constructor(svg, help, actions) {
    Object.assign(this, { svg, help, actions });
    for (const layer of LAYERS) this[`${layer}Layer`] = make("g", { "data-layer": layer }, svg);
    this.shape = new LinkageShape(this.linkageLayer);
    this.shape.show(null);
    this.poses = new Poses(this.posesLayer, (k) => this.chosen !== k && actions.choose(k));
    for (const [name, dot] of Object.entries(this.shape.joints))
      dot.addEventListener("keydown", (event) => this.#move(name, event));
    this.setMode("move");
    new ResizeObserver(() => this.#resize()).observe(svg);
    svg.addEventListener("pointerdown", (event) => this.#press(event));
    svg.addEventListener("keydown", (event) => this.#key(event));
    svg.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
    this.#resize();
  }

  #resize() {
    const { clientWidth: width, clientHeight: height } = this.svg;
    if (!width || !height) return;
    Object.assign(this.view, { width, height });
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    if (this.fitted && !this.moved && this.motion) this.fit();
    else this.draw();
  }

  #wheel(event) {
    event.preventDefault();
    this.zoom(Math.exp(-event.deltaY / 300), ...this.#pixel(event));
  }

  /** Shows a sentence on the canvas for a moment. */
  tell(sentence) {
    const note = this.svg.parentNode.querySelector("p");
    note.textContent = sentence;
    note.classList.add("shown");
    clearTimeout(this.told);
    this.told = setTimeout(() => note.classList.remove("shown"), 1600);
  }

  setMode(mode) {
    this.mode = mode;
    this.corners = [];
    this.svg.dataset.mode = mode;
    this.#explain();
    // joints that can be moved are there for screen readers and the tab key too
    const { group, joints } = this.shape,
      movable = mode === "hand",
      label = (name) => `Joint ${name.toUpperCase()}, moved by the arrow keys`;
    put(group, { "aria-hidden": String(!movable) });
    for (const [name, dot] of Object.entries(joints))
      if (movable) put(dot, { tabindex: 0, role: "button", "aria-label": label(name) });
      else for (const attribute of ["tabindex", "role", "aria-label"]) dot.removeAttribute(attribute);
    if (this.motion) this.draw();
  }

  /** Draws a motion with the pose of index `chosen` selected. */
  show(motion, chosen) {
    this.motion = motion;
    this.chosen = Math.max(0, Math.min(chosen, motion.poses.length - 1));
    this.#explain();
    this.draw();
  }

  #explain() {
    if (this.motion) this.help.textContent = HELP(itemOf(this.motion), wantsAngles(this.motion))[this.mode];
  }

  /** Draws path, errors and ghosts of a linkage, {used, turn, errors, at, worst, band}; null removes them. */
  showLinkage(found) {
    this.linkage = found;
    this.draw();
  }

  /** Draws other linkages, {used, at}, faintly. */
  showOthers(linkages) {
    this.others = linkages;
    this.draw();
  }

  /** Draws the linkage itself at joints of `Linkage.at`; null where it does not close. */
  showJoints(joints) {
    this.joints = joints;
    this.shape.show(this.linkage ? joints : null, this.view, !this.motion || wantsAngles(this.motion));
    if (this.motion?.outline || this.bodyLayer.childElementCount)
      drawBody(this.bodyLayer, this.motion?.outline, this.linkage && joints, this.view);
    for (const after of this.seen) after();
  }

  get hasPlaces() {
    return this.motion && wantsPlaces(this.motion);
  }

  get places() {
    return this.motion ? placesOf(this.motion) : [];
  }

  /** Points of what drives the linkage. */
  driven = () => [];

  /** Brings points that lie outside into a view that the user has not moved. */
  reveal(points = this.places) {
    if (this.holds(points)) return;
    if (this.moved) this.tell("Parts lie outside the view: Fit shows all");
    else this.fit();
  }

  /** Fits the motion, the linkage and its drive into the view, whose changes of size fit them again. */
  fit() {
    Object.assign(this, { fitted: true, moved: false });
    const points = this.places,
      box = this.motion?.limits.box;
    if (box && this.hasPlaces) points.push(box.slice(0, 2), box.slice(2));
    if (this.linkage) for (const j of this.linkage.used) if (j) points.push(j.a, j.b, j.c, j.d, j.p);
    if (this.linkage && !this.stale) points.push(...this.driven());
    const [first] = points,
      isFirst = (point) => point && point[0] === first[0] && point[1] === first[1];
    if (this.hasPlaces && first && points.every(isFirst))
      points.push(...[50, -50].map((far) => first.map((value) => value + far)));
    this.view.fit(points, this.view.width < 500 ? 38 : 52);
    this.draw();
  }

  holds(points) {
    return points.every((point) => {
      const [x, y] = this.view.at(point);
      return x >= 0 && y >= 0 && x <= this.view.width && y <= this.view.height;
    });
  }

  zoom(factor, ...at) {
    this.view.zoom(factor, ...at);
    this.moved = true;
    this.draw();
  }

  draw() {
    const { view, motion, linkage, stale } = this;
    const shown = JSON.stringify(view);
    if (shown !== this.shown) this.step = drawGrid(this.gridLayer, view);
    this.shown = shown;
    this.svg.dataset.view = `${view.cx} ${view.cy} ${view.scale}`;
    drawBox(this.boxLayer, motion, view);
    if (motion) {
      drawWay(
        this.wayLayer,
        motion,
        view,
        motion.poses.length || linkage ? null : EMPTY(itemOf(motion), motion.law)[this.mode],
      );
      drawCurves(this.curvesLayer, this.targetsLayer, { linkage, stale, view, unit: motion.unit });
      if (this.ghosts) drawGhosts(this.ghostsLayer, motion, linkage, view);
      else this.ghostsLayer.replaceChildren();
      drawOverlay(this.overlayLayer, this.others, view);
      this.poses.draw(motion, this.chosen, view);
      if (this.mode === "outline") this.#drawCorners();
    }
    this.showJoints(this.joints);
    for (const layer of [this.linkageLayer, this.curvesLayer, this.bodyLayer]) layer.classList.toggle("dimmed", stale);
    for (const after of this.redrawn) after(view);
  }

  /** Top left corner of the canvas on the page. Reading it in each frame of a drag would force a layout. */
  get #origin() {
    const { left, top } = this.svg.getBoundingClientRect();
    return [left + this.svg.clientLeft, top + this.svg.clientTop];
  }

  #pixel({ clientX, clientY }, origin = this.#origin) {
    return less([clientX, clientY], origin);
  }

  /** World coordinates of a pixel, on a tenth of the grid where it snaps, else rounded below a pixel's size. */
  place(px, py) {
    const unit = this.snap ? this.step / 10 : 10 ** Math.floor(Math.log10(1 / this.view.scale));
    return this.view.world(px, py).map((value) => Number((Math.round(value / unit) * unit).toPrecision(12)));
  }

  /** A point that was dragged from one pixel to another; back at the first pixel it is where it was. */
  #dragged(point, [px, py], [qx, qy]) {
    if (qx === px && qy === py) return point;
    const [x, y] = this.view.at(point);
    return this.place(x + qx - px, y + qy - py);
  }

  // -- pointer --

  #press(event) {
    if (event.button !== 0) return;
    const at = this.#pixel(event),
      { target } = event,
      { mode, actions } = this,
      poseNode = target.closest(".pose"),
      joint = target.getAttribute("data-joint"),
      corner = target.getAttribute("data-corner")?.split(" ").map(Number);
    if (mode === "path") this.#trace(event, at);
    else if (mode === "outline") this.#click(event, at, () => this.#addCorner(at));
    else if (mode === "hand" && joint && this.joints) this.#dragJoint(event, joint, at, actions.hand);
    else if (poseNode && (mode === "move" || mode === "add")) this.#dragPose(event, poseNode, at);
    else if (mode === "move" && this.#isPivot(joint) && !this.stale) this.#dragJoint(event, joint, at, actions.pivot);
    else if (corner && this.hasPlaces) {
      const [i, j] = corner,
        { box } = this.motion.limits;
      this.#dragBox(event, [box[2 - i], box[4 - j]], [box[i], box[j]], at);
    } else if (mode === "box" && this.hasPlaces) {
      const first = this.place(...at);
      this.#dragBox(event, first, first, at);
    } else
      this.#click(event, at, () => {
        if (mode !== "add" || !this.hasPlaces) return;
        this.fitted = false;
        actions.add(this.place(...at));
      });
  }

  /** A press that stays is a click; one that moves drags the view. */
  #click(event, [px, py], clicked) {
    const { cx, cy, scale } = this.view;
    let moved = false;
    const move = (qx, qy) => {
      moved ||= Math.hypot(qx - px, qy - py) > CLICK;
      if (!moved) return;
      Object.assign(this.view, { cx: cx - (qx - px) / scale, cy: cy + (qy - py) / scale });
      Object.assign(this, { fitted: false, moved: true });
      this.draw();
    };
    this.follow(event, move, (cancelled) => {
      if (!moved && !cancelled) clicked();
    });
  }

  #dragPose(event, poseNode, at) {
    const k = Number(poseNode.dataset.pose),
      turning = event.target.hasAttribute("data-turner");
    this.actions.choose(k);
    poseNode.focus({ preventScroll: true });
    const { x, y, angle } = this.motion.poses[k];
    const change = (to) => (motion) => {
      const moved = motion.poses[k];
      if (moved && turning) moved.angle = to[0] === at[0] && to[1] === at[1] ? angle : this.#angle(moved, to);
      else if (moved) [moved.x, moved.y] = this.#dragged([x, y], at, to);
    };
    this.follow(event, (...to) => this.actions.edit(change(to), `drag ${k}`));
  }

  /** The angle of a pose whose arm is pulled to a pixel, nearest to its angle before, so that whole turns stay. */
  #angle({ x, y, angle }, [qx, qy]) {
    const [px, py] = this.view.at([x, y]),
      found = (Math.atan2(py - qy, qx - px) * 180) / Math.PI;
    const near = found + 360 * Math.round((angle - found) / 360);
    return this.snap ? Math.round(near) : Number(near.toFixed(1));
  }

  /** Return true if a joint is a fixed pivot of the linkage. */
  #isPivot(joint) {
    return Boolean(this.joints?.[joint]) && this.joints.fixed[["a", "b"].indexOf(joint)];
  }

  #dragJoint(event, joint, at, move) {
    const start = this.joints[joint];
    this.follow(event, (...to) => move(joint, this.#dragged(start, at, to)));
  }

  /** A drag draws a path, which begins a new motion; a tap adds a point to the path that there is. */
  #trace(event, at) {
    const pen = new Pen(this.penLayer, ...at);
    const end = (cancelled) => {
      const { points, closed } = pen.end(),
        positions = points.map((point) => this.place(...point));
      if (cancelled) return;
      this.fitted = false;
      if (positions.length === 1 && !wantsAngles(this.motion) && this.motion.poses.length)
        this.actions.add(positions[0]);
      else this.actions.draw(positions, closed);
    };
    this.follow(event, (...to) => pen.move(...to), end);
  }

  /** Drags the corner of the pivot box that lies opposite to [x, y]. */
  #dragBox(event, [x, y], corner, at) {
    const change = (to) => (motion) => {
      const [u, v] = this.#dragged(corner, at, to);
      motion.limits.box = [Math.min(x, u), Math.min(y, v), Math.max(x, u), Math.max(y, v)];
    };
    this.follow(event, (...to) => this.actions.edit(change(to), "box"));
  }

  /** Calls `move(px, py)` while the pointer is held, then `end(cancelled)`. */
  follow(event, move, end = () => this.actions.settle()) {
    event.preventDefault();
    const { pointerId } = event,
      origin = this.#origin;
    this.svg.setPointerCapture(pointerId);
    this.held = true;
    const moved = (at) => {
      if (at.pointerId === pointerId) move(...this.#pixel(at, origin));
    };
    const done = (at) => {
      if (at.pointerId !== pointerId) return;
      for (const name of ["pointerup", "pointercancel"]) this.svg.removeEventListener(name, done);
      this.svg.removeEventListener("pointermove", moved);
      this.held = false;
      end(at.type === "pointercancel");
    };
    this.svg.addEventListener("pointermove", moved);
    for (const name of ["pointerup", "pointercancel"]) this.svg.addEventListener(name, done);
  }

  // -- the body's outline, drawn at the selected pose --

  #addCorner([px, py]) {
    const [x, y] = this.corners.length > 2 ? this.view.at(this.corners[0]) : [Infinity, 0];
    if (Math.hypot(x - px, y - py) < 10) this.#closeOutline();
    else {
      this.corners.push(this.place(px, py));
      this.#drawCorners();
    }
  }

  #drawCorners() {
    const { corners, penLayer, view } = this;
    penLayer.replaceChildren();
    make("path", { class: "pen", d: pathData(corners, view) }, penLayer);
    for (const [x, y] of corners) make("circle", { class: "corner", cx: view.x(x), cy: view.y(y), r: 4 }, penLayer);
  }

  #closeOutline() {
    const pose = this.motion.poses[this.chosen],
      position = placeOf(pose) ?? [0, 0],
      local = (corner) => turned(less(corner, position), -(pose.angle ?? 0) * RAD),
      outline = [...this.corners, this.corners[0]].map((corner) => local(corner).map((x) => Number(x.toPrecision(6))));
    this.corners = [];
    this.penLayer.replaceChildren();
    this.actions.edit((motion) => (motion.outline = [outline]));
  }

  // -- keys --

  /** Return the displacement of an arrow key: a tenth of the grid step, or with Shift a whole step; else undefined. */
  nudge({ key, shiftKey }) {
    const go = (shiftKey ? 1 : 0.1) * this.step;
    return { ArrowLeft: [-go, 0], ArrowRight: [go, 0], ArrowDown: [0, -go], ArrowUp: [0, go] }[key];
  }

  #move(name, event) {
    const by = this.nudge(event);
    if (!by || !this.joints) return;
    event.preventDefault();
    this.actions.hand(name, add(this.joints[name], by));
  }

  #key(event) {
    if (this.mode === "outline" && event.key === "Enter" && this.corners.length > 2) {
      this.#closeOutline();
      event.preventDefault();
      return;
    }
    const poseNode = event.target.closest?.(".pose");
    if (!poseNode || event.ctrlKey || event.metaKey || event.altKey) return;
    const k = Number(poseNode.dataset.pose);
    const by = this.nudge(event),
      turn = (event.shiftKey ? 10 : 1) * ({ "[": 1, "{": 1, "]": -1, "}": -1 }[event.key] ?? 0);
    if (by || turn) {
      const [dx, dy] = by ?? [0, 0],
        tidy = (value) => Number((Math.abs(value) < SMALL * this.step ? 0 : value).toPrecision(12));
      this.actions.edit((motion) => {
        const pose = motion.poses[k];
        pose.x = tidy(pose.x + dx);
        pose.y = tidy(pose.y + dy);
        if (turn) pose.angle = Number(((pose.angle ?? 0) + turn).toPrecision(12));
      }, `key ${k} ${event.key}`);
    } else if (event.key === "Delete" || event.key === "Backspace") {
      this.actions.remove(k);
    } else if (event.key === "Enter" || event.key === "Insert") {
      this.actions.add(null);
      this.poses.focus(-1);
    } else if (event.key === "PageDown" || event.key === "PageUp") {
      const next = Math.max(0, Math.min(this.motion.poses.length - 1, k + (event.key === "PageDown" ? 1 : -1)));
      this.actions.choose(next);
      this.poses.focus(next);
    } else return;
    event.preventDefault();
  }
}
