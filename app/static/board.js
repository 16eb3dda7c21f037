// The canvas of the motion editor: draggable poses, the pivot box, and the selected linkage drawn over them.

import { LinkageShape, View, make, pathData, put, roundStep, text } from "./drawing.js";
import { placeOf, wantsAngles, wantsPlaces } from "./motion.js";
import { PATH_POINTS, Pen } from "./pen.js";

const ARM = 30; // pixels from the selected pose to the handle that turns it
const EMPTY = { move: "No poses yet: draw a path or add poses", add: "Click the place of the first pose", path: "Draw a path here", box: "Drag a box for both fixed pivots" };
const HELP = {
  move: "Drag a pose, or the end of its arm to turn it. Keys: arrows move, [ and ] turn, Page Up and Down select, Enter adds one, Delete removes.",
  add: "Click the place of the next pose. Keys: Add a pose below, then arrows move it, and Enter adds the next.",
  path: `Drag along the way that a point of the body shall take: it becomes ${PATH_POINTS} points of a new motion. Or click point after point. Keys: New path and Add a point below, then arrows move it, and Enter adds the next.`,
  box: "Drag a box that must contain both fixed pivots; drag its corners to change it.",
};

/**
 * Changes the motion only through `actions`: `edit(change, kind)`, `settle()` at the end of a drag, `choose(k)`, `add(at)`,
 * `remove(k)`, `draw(places, closed)` for a path drawn by hand, which begins a new motion. `stale` says that the linkage belongs to an earlier motion; it is drawn dimmed.
 */
export class Board {
  constructor(svg, help, actions) {
    Object.assign(this, { svg, help, actions, view: new View(600, 400), mode: "move", chosen: 0, fitted: false, stale: false });
    for (const layer of ["grid", "box", "way", "curves", "targets", "linkage", "poses", "pen"]) this[`${layer}Layer`] = make("g", { "data-layer": layer }, svg);
    this.shape = new LinkageShape(this.linkageLayer);
    this.shape.show(null);
    this.poses = [];
    this.motion = null;
    this.linkage = null;
    this.setMode("move");
    new ResizeObserver(() => this.resize()).observe(svg);
    svg.addEventListener("pointerdown", (event) => this.press(event));
    svg.addEventListener("keydown", (event) => this.key(event));
    svg.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.metaKey) return;
      event.preventDefault();
      const [px, py] = this.pixel(event);
      this.view.zoom(Math.exp(-event.deltaY / 300), px, py);
      this.draw();
    }, { passive: false });
    this.resize();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.svg;
    if (!width || !height) return;
    const wider = width !== this.view.width;
    Object.assign(this.view, { width, height });
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    // a change of height alone, as when the table beside the canvas grows, must not move the drawing
    if (wider && this.fitted && this.motion) this.fit();
    else this.draw();
  }

  setMode(mode) {
    this.mode = mode;
    this.svg.dataset.mode = mode;
    this.help.textContent = HELP[mode];
    if (this.motion) this.draw();
  }

  /** Draws a motion with the pose of index `chosen` selected. */
  show(motion, chosen) {
    this.motion = motion;
    this.chosen = Math.max(0, Math.min(chosen, motion.poses.length - 1));
    this.draw();
  }

  /** Draws the curves and errors of a linkage, {used, turn, errors}; null removes them. */
  showLinkage(found) {
    this.linkage = found;
    this.draw();
  }

  /** Draws the linkage itself at joints of `Linkage.at`; null where it does not close. */
  showJoints(joints) {
    this.joints = joints;
    this.shape.show(this.linkage ? joints : null, this.view);
  }

  get hasPlaces() { return this.motion && wantsPlaces(this.motion); }

  fit() {
    const { clientWidth: width, clientHeight: height } = this.svg;
    if (width && height) {
      Object.assign(this.view, { width, height });
      this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    }
    this.fitted = true;
    const points = this.hasPlaces ? this.motion.poses.map(placeOf).filter(Boolean) : [];
    const box = this.motion?.limits.box;
    if (box && this.hasPlaces) points.push([box[0], box[1]], [box[2], box[3]]);
    if (this.linkage) for (const j of this.linkage.used) if (j) points.push(j.a, j.b, j.c, j.d, j.p);
    if (this.hasPlaces && points.length && points.every(([x, y]) => x === points[0][0] && y === points[0][1])) points.push([points[0][0] + 50, points[0][1] + 50], [points[0][0] - 50, points[0][1] - 50]);
    this.view.fit(points, this.view.width < 500 ? 38 : 52);
    this.draw();
  }

  zoom(factor) {
    this.view.zoom(factor);
    this.draw();
  }

  draw() {
    const { view } = this;
    this.svg.dataset.view = `${view.cx} ${view.cy} ${view.scale}`;
    this.drawGrid();
    this.drawBox();
    this.drawWay();
    this.drawCurves();
    this.drawPoses();
    this.shape.show(this.linkage ? this.joints : null, view);
    this.linkageLayer.classList.toggle("dimmed", this.stale);
    this.curvesLayer.classList.toggle("dimmed", this.stale);
  }

  drawGrid() {
    const { view, gridLayer } = this;
    gridLayer.replaceChildren();
    const step = roundStep(56 / view.scale);
    const [left, high] = view.world(0, 0), [right, low] = view.world(view.width, view.height);
    let minor = "", axis = "";
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    const name = (value) => (Math.abs(value) >= 1e6 || (value !== 0 && digits > 5) ? text(value, 4) : value.toFixed(Math.min(digits, 20)));
    for (let k = Math.ceil(left / step); k <= right / step && gridLayer.childElementCount < 400; k++) {
      const x = Math.round(view.x(k * step)) + 0.5;
      if (k === 0) axis += `M${x} 0V${view.height}`;
      else minor += `M${x} 0V${view.height}`;
      if (x > 34 && x < view.width - 14) make("text", { class: "tick", x, y: view.height - 6, "text-anchor": "middle", "aria-hidden": "true" }, gridLayer).textContent = name(k * step);
    }
    for (let k = Math.ceil(low / step); k <= high / step && gridLayer.childElementCount < 800; k++) {
      const y = Math.round(view.y(k * step)) + 0.5;
      if (k === 0) axis += `M0 ${y}H${view.width}`;
      else minor += `M0 ${y}H${view.width}`;
      if (y > 14 && y < view.height - 22) make("text", { class: "tick", x: 5, y: y - 3, "aria-hidden": "true" }, gridLayer).textContent = name(k * step);
    }
    gridLayer.prepend(make("path", { class: "grid", d: minor }), make("path", { class: "axis", d: axis }));
    this.step = step;
  }

  drawBox() {
    const box = this.hasPlaces ? this.motion.limits.box : null;
    this.boxLayer.replaceChildren();
    if (!box) return;
    const [x0, y0] = this.view.at([box[0], box[3]]), [x1, y1] = this.view.at([box[2], box[1]]);
    make("rect", { class: "pivot-box", x: Math.min(x0, x1), y: Math.min(y0, y1), width: Math.abs(x1 - x0), height: Math.abs(y1 - y0) }, this.boxLayer);
    const label = make("text", { class: "tick", x: Math.min(x0, x1) + 7, y: Math.min(y0, y1) + 16 }, this.boxLayer);
    label.textContent = "pivots";
    for (const [x, y, i, j] of [[x0, y0, 0, 3], [x1, y0, 2, 3], [x1, y1, 2, 1], [x0, y1, 0, 1]])
      make("rect", { class: "box-handle", x: x - 5, y: y - 5, width: 10, height: 10, rx: 2, "data-corner": `${i} ${j}` }, this.boxLayer);
  }

  /** The way from pose to pose where the crank angles are free, and what to do on an empty canvas. */
  drawWay() {
    this.wayLayer.replaceChildren();
    if (!this.motion) return;
    const { motion, view } = this, places = this.hasPlaces ? motion.poses.map(placeOf).filter(Boolean) : [];
    if (!motion.poses.length && !this.linkage) {
      const size = view.width < 500 ? 15 : 18;
      make("text", { class: "invite", x: view.width / 2, y: view.height / 2 - size, "font-size": size, "text-anchor": "middle", "aria-hidden": "true" }, this.wayLayer).textContent = EMPTY[this.mode];
    }
    if (motion.timing !== "free" || motion.anyOrder || places.length < 2) return;
    make("path", { class: "way", d: pathData(places, view) }, this.wayLayer);
    if (motion.closed && places.length > 2) make("path", { class: "way return", d: pathData([places.at(-1), places[0]], view) }, this.wayLayer);
  }

  drawCurves() {
    const { view, linkage } = this;
    this.curvesLayer.replaceChildren();
    this.targetsLayer.replaceChildren();
    if (!linkage) return;
    this.drawBand();
    const way = (list) => pathData(list.map((j) => j && (j.p ?? j.c)), view);
    if (linkage.turn) make("path", { class: "curve turn", d: way(linkage.turn) }, this.curvesLayer);
    make("path", { class: "curve", d: way(linkage.used), "data-curve": "used" }, this.curvesLayer);
    if (!linkage.errors || this.stale) return;
    const errors = linkage.errors.filter(Boolean);
    const longest = Math.max(...errors.map(([from, to]) => Math.hypot(to[0] - from[0], to[1] - from[1])));
    const pixels = longest * view.scale;
    if (!(pixels > 1e-7)) return;
    const factor = pixels >= 3 ? 1 : 10 ** Math.min(9, Math.ceil(Math.log10(12 / pixels)));
    for (const [from, to] of errors) {
      const [x, y] = view.at(from);
      const dx = (to[0] - from[0]) * view.scale * factor, dy = -(to[1] - from[1]) * view.scale * factor;
      make("path", { class: "miss", d: `M${x} ${y}l${dx} ${dy}` }, this.targetsLayer);
    }
    make("text", { class: "miss-note", x: view.width - 10, y: 18, "text-anchor": "end" }, this.targetsLayer).textContent =
      `errors drawn ${factor === 1 ? "to scale" : `${factor < 1e5 ? factor : factor.toExponential(0)} times larger`}`;
  }

  /** The band around the path that 95 % of the linkages made keep to; wider than it is where it would not be seen. */
  drawBand() {
    const { view, linkage: { band } } = this, along = band?.filter(Boolean) ?? [];
    const widest = Math.max(0, ...along.map(([, radius]) => radius)) * view.scale;
    if (along.length < 2 || !(widest > 1e-7)) return;
    const factor = widest >= 3 ? 1 : roundStep(5 / widest);
    const edges = [[], []];
    along.forEach(([place, radius], k) => {
      const [x, y] = view.at(place), [x0, y0] = view.at(along[Math.max(0, k - 1)][0]), [x1, y1] = view.at(along[Math.min(along.length - 1, k + 1)][0]);
      const length = Math.hypot(x1 - x0, y1 - y0) || 1, far = radius * view.scale * factor;
      for (const side of [0, 1]) edges[side].push([x + ((side ? 1 : -1) * far * (y1 - y0)) / length, y - ((side ? 1 : -1) * far * (x1 - x0)) / length]);
    });
    const outline = [...edges[0], ...edges[1].reverse()].map(([x, y]) => `${x.toFixed(2)} ${y.toFixed(2)}`);
    make("path", { class: "band", d: `M${outline.join("L")}Z` }, this.curvesLayer);
    make("text", { class: "band-note", x: view.width - 10, y: 36, "text-anchor": "end" }, this.targetsLayer).textContent =
      `95 % of those made are within the band${factor === 1 ? "" : `, drawn ${factor < 1e5 ? factor : factor.toExponential(0)} times wider`}`;
  }

  drawPoses() {
    const poses = this.hasPlaces ? this.motion.poses : [];
    while (this.poses.length > poses.length) this.poses.pop().group.remove();
    while (this.poses.length < poses.length) this.poses.push(this.makePose(this.poses.length));
    const placed = poses.map(placeOf).filter(Boolean);
    let way = 0;
    for (let k = 1; k < placed.length; k++) way += Math.hypot(placed[k][0] - placed[k - 1][0], placed[k][1] - placed[k - 1][1]) * this.view.scale;
    const crowded = placed.length > 4 && way / (placed.length - 1) < 16;
    this.posesLayer.classList.toggle("crowded", crowded);
    const last = poses.length - 1;
    poses.forEach((pose, k) => {
      const parts = this.poses[k], chosen = k === this.chosen, place = placeOf(pose);
      parts.group.setAttribute("visibility", place ? "inherit" : "hidden");
      if (!place) return;
      const turning = wantsAngles(this.motion) && pose.angle !== null;
      const [x, y] = this.view.at(place);
      const turn = turning ? (pose.angle * Math.PI) / 180 : -Math.PI / 2;
      const arm = chosen ? ARM : crowded ? 13 : 18;
      const ax = arm * Math.cos(turn), ay = -arm * Math.sin(turn);
      put(parts.group, {
        transform: `translate(${x} ${y})`, class: chosen ? "pose chosen" : "pose", tabindex: chosen ? 0 : -1,
        "aria-label": `${wantsAngles(this.motion) ? "Pose" : "Point"} ${k + 1} of ${poses.length}: x ${text(pose.x, 4)}, y ${text(pose.y, 4)}${turning ? `, angle ${text(pose.angle, 4)} degrees` : ""}`,
      });
      put(parts.dot, { r: chosen ? 5 : crowded ? 2.6 : 4.5 });
      put(parts.hit, { r: crowded && !chosen ? 7 : 11 });
      put(parts.arm, { d: turning ? `M0 0L${ax} ${ay}` : "" });
      put(parts.turner, { cx: ax, cy: ay, visibility: chosen && turning ? "inherit" : "hidden" });
      put(parts.turnHit, { cx: ax, cy: ay, visibility: chosen && turning ? "inherit" : "hidden" });
      const named = chosen || k === 0 || k === last || (this.motion.anyOrder && !crowded);
      parts.label.textContent = named ? String(k + 1) : "";
      // on the side of the pose that its arm does not point to
      put(parts.label, { x: -11 * Math.cos(turn + 0.6), y: 11 * Math.sin(turn + 0.6) + 4 });
    });
  }

  makePose(k) {
    const group = make("g", { class: "pose", role: "button", "data-pose": k }, this.posesLayer);
    const arm = make("path", { class: "arm" }, group);
    make("circle", { class: "ring", r: 11 }, group);
    const dot = make("circle", { class: "dot", r: 4.5 }, group);
    const hit = make("circle", { class: "hit", r: 11 }, group);
    const turnHit = make("circle", { class: "hit", r: 12, "data-turner": "" }, group);
    const turner = make("circle", { class: "turner", r: 5, "data-turner": "" }, group);
    const label = make("text", { "text-anchor": "middle", "aria-hidden": "true" }, group);
    group.addEventListener("focus", () => { if (this.chosen !== k) this.actions.choose(k); });
    return { group, arm, dot, hit, turner, turnHit, label };
  }

  pixel(event) {
    const frame = this.svg.getBoundingClientRect();
    return [event.clientX - frame.left - this.svg.clientLeft, event.clientY - frame.top - this.svg.clientTop];
  }

  /** World coordinates of a pixel, rounded to the power of ten below a pixel's size. */
  place(px, py) {
    const unit = 10 ** Math.floor(Math.log10(1 / this.view.scale));
    return this.view.world(px, py).map((value) => Number((Math.round(value / unit) * unit).toPrecision(12)));
  }

  press(event) {
    if (event.button !== 0) return;
    const [px, py] = this.pixel(event);
    const target = event.target;
    const corner = target.getAttribute("data-corner");
    const held = target.closest(".pose");
    if (this.mode === "add" && this.hasPlaces) {
      event.preventDefault();
      this.fitted = false;
      this.actions.add(this.place(px, py));
      return;
    }
    if (this.mode === "path") {
      this.trace(event, px, py);
      return;
    }
    if (held && this.mode === "move") {
      const k = Number(held.dataset.pose);
      const turning = target.hasAttribute("data-turner");
      this.actions.choose(k);
      held.focus({ preventScroll: true });
      const pose = this.motion.poses[k];
      const from = this.place(px, py), origin = [pose.x, pose.y];
      this.follow(event, (qx, qy) => this.actions.edit((motion) => {
        const moved = motion.poses[k];
        if (!moved) return;
        if (turning) {
          const [x, y] = this.view.at([moved.x, moved.y]);
          const angle = (Math.atan2(y - qy, qx - x) * 180) / Math.PI;
          // whole turns are kept: of the equal directions the one nearest to the present angle
          moved.angle = Number((angle + 360 * Math.round((moved.angle - angle) / 360)).toFixed(1));
        } else {
          const to = this.place(qx, qy);
          [moved.x, moved.y] = [0, 1].map((i) => Number((origin[i] + to[i] - from[i]).toPrecision(12)));
        }
      }, `drag ${k}`));
      return;
    }
    if (corner && this.hasPlaces) {
      const [i, j] = corner.split(" ").map(Number);
      const box = this.motion.limits.box;
      this.dragBox(event, [box[i === 0 ? 2 : 0], box[j === 1 ? 3 : 1]]);
      return;
    }
    if (this.mode === "box" && this.hasPlaces) {
      this.dragBox(event, this.place(px, py));
      return;
    }
    if (event.pointerType === "touch") return;
    const { cx, cy, scale } = this.view;
    this.follow(event, (qx, qy) => {
      Object.assign(this.view, { cx: cx - (qx - px) / scale, cy: cy + (qy - py) / scale });
      this.fitted = false;
      this.draw();
    });
  }

  /** A drag draws a path, which begins a new motion; a tap adds a point to the path that there is. */
  trace(event, px, py) {
    const pen = new Pen(this.penLayer, px, py);
    this.follow(event, (qx, qy) => pen.move(qx, qy), (cancelled) => {
      const { points, closed } = pen.end();
      if (cancelled) return;
      this.fitted = false;
      const places = points.map(([x, y]) => this.place(x, y));
      if (places.length === 1 && !wantsAngles(this.motion) && this.motion.poses.length) this.actions.add(places[0]);
      else this.actions.draw(places, closed);
    });
  }

  dragBox(event, [x, y]) {
    this.follow(event, (qx, qy) => this.actions.edit((motion) => {
      const [u, v] = this.place(qx, qy);
      motion.limits.box = [Math.min(x, u), Math.min(y, v), Math.max(x, u), Math.max(y, v)];
    }, "box"));
  }

  /** Calls `move(px, py)` while the pointer is held, then `end(cancelled)`. */
  follow(event, move, end = () => this.actions.settle()) {
    event.preventDefault();
    const { pointerId } = event;
    this.svg.setPointerCapture(pointerId);
    const moved = (at) => { if (at.pointerId === pointerId) move(...this.pixel(at)); };
    const done = (at) => {
      if (at.pointerId !== pointerId) return;
      for (const name of ["pointerup", "pointercancel"]) this.svg.removeEventListener(name, done);
      this.svg.removeEventListener("pointermove", moved);
      end(at.type === "pointercancel");
    };
    this.svg.addEventListener("pointermove", moved);
    for (const name of ["pointerup", "pointercancel"]) this.svg.addEventListener(name, done);
  }

  key(event) {
    const held = event.target.closest?.(".pose");
    if (!held || event.ctrlKey || event.metaKey || event.altKey) return;
    const k = Number(held.dataset.pose);
    const go = (event.shiftKey ? 1 : 0.1) * this.step;
    const turn = event.shiftKey ? 10 : 1;
    const moves = {
      ArrowLeft: [-go, 0, 0], ArrowRight: [go, 0, 0], ArrowDown: [0, -go, 0], ArrowUp: [0, go, 0],
      "[": [0, 0, turn], "]": [0, 0, -turn], "{": [0, 0, turn], "}": [0, 0, -turn],
    };
    const move = moves[event.key];
    if (move) {
      this.actions.edit((motion) => {
        const pose = motion.poses[k];
        pose.x = Number((pose.x + move[0]).toPrecision(12));
        pose.y = Number((pose.y + move[1]).toPrecision(12));
        if (move[2]) pose.angle = Number(((pose.angle ?? 0) + move[2]).toPrecision(12));
      }, `key ${k} ${event.key}`);
    } else if (event.key === "Delete" || event.key === "Backspace") {
      this.actions.remove(k);
    } else if (event.key === "Enter" || event.key === "Insert") {
      this.actions.add(null);
      this.poses.at(-1).group.focus({ preventScroll: true });
    } else if (event.key === "PageDown" || event.key === "PageUp") {
      const next = Math.max(0, Math.min(this.motion.poses.length - 1, k + (event.key === "PageDown" ? 1 : -1)));
      this.actions.choose(next);
      this.poses[next].group.focus({ preventScroll: true });
    } else return;
    event.preventDefault();
  }
}
