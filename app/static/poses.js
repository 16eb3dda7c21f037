// The wanted poses on the canvas: a dot and an arm for each, those of the selected one with a handle that turns it.

import { make, put, text } from "./drawing.js";
import { placeOf, wantsAngles, wantsPlaces } from "./motion.js";

const ARM = 30; // pixels from the selected pose to the handle that turns it

export class Poses {
  /** `choose(k)` is called when a pose gets the focus. */
  constructor(layer, choose) {
    Object.assign(this, { layer, choose, made: [] });
  }

  focus(k) {
    this.made.at(k)?.group.focus({ preventScroll: true });
  }

  draw(motion, chosen, view) {
    const poses = wantsPlaces(motion) ? motion.poses : [];
    while (this.made.length > poses.length) this.made.pop().group.remove();
    while (this.made.length < poses.length) this.made.push(this.#make(this.made.length));
    const placed = poses.map(placeOf).filter(Boolean);
    let pathLength = 0;
    for (let k = 1; k < placed.length; k++)
      pathLength += Math.hypot(placed[k][0] - placed[k - 1][0], placed[k][1] - placed[k - 1][1]) * view.scale;
    const crowded = placed.length > 4 && pathLength / (placed.length - 1) < 16;
    this.layer.classList.toggle("crowded", crowded);
    const last = poses.length - 1;
    poses.forEach((pose, k) => {
      const parts = this.made[k],
        selected = k === chosen,
        position = placeOf(pose);
      parts.group.setAttribute("visibility", position ? "inherit" : "hidden");
      if (!position) return;
      const turning = wantsAngles(motion) && pose.angle !== null;
      const [x, y] = view.at(position);
      const turn = turning ? (pose.angle * Math.PI) / 180 : -Math.PI / 2;
      const arm = selected ? ARM : crowded ? 13 : 18;
      const ax = arm * Math.cos(turn),
        ay = -arm * Math.sin(turn);
      const where = `x ${text(pose.x, 4)}, y ${text(pose.y, 4)} ${motion.unit}`,
        name = wantsAngles(motion) ? "Pose" : "Point",
        angle = turning ? `, angle ${text(pose.angle, 4)} degrees` : "";
      put(parts.group, {
        transform: `translate(${x} ${y})`,
        class: selected ? "pose chosen" : "pose",
        tabindex: selected ? 0 : -1,
        "aria-label": `${name} ${k + 1} of ${poses.length}: ${where}${angle}`,
      });
      put(parts.dot, { r: selected ? 5 : crowded ? 2.6 : 4.5 });
      put(parts.hit, { r: crowded && !selected ? 7 : 11 });
      put(parts.arm, { d: turning ? `M0 0L${ax} ${ay}` : "" });
      put(parts.turner, { cx: ax, cy: ay, visibility: selected && turning ? "inherit" : "hidden" });
      put(parts.turnHit, { cx: ax, cy: ay, visibility: selected && turning ? "inherit" : "hidden" });
      const named = selected || k === 0 || k === last || (!crowded && (motion.anyOrder || poses.length <= 12));
      parts.label.textContent = named ? String(k + 1) : "";
      // on the side of the pose that its arm does not point to
      put(parts.label, { x: -11 * Math.cos(turn + 0.6), y: 11 * Math.sin(turn + 0.6) + 4 });
    });
  }

  #make(k) {
    const group = make("g", { class: "pose", role: "button", "data-pose": k }, this.layer);
    const arm = make("path", { class: "arm" }, group);
    make("circle", { class: "ring", r: 11 }, group);
    const dot = make("circle", { class: "dot", r: 4.5 }, group);
    const hit = make("circle", { class: "hit", r: 11 }, group);
    const turnHit = make("circle", { class: "hit", r: 12, "data-turner": "" }, group);
    const turner = make("circle", { class: "turner", r: 5, "data-turner": "" }, group);
    const label = make("text", { "text-anchor": "middle", "aria-hidden": "true" }, group);
    group.addEventListener("focus", () => this.choose(k));
    return { group, arm, dot, hit, turner, turnHit, label };
  }
}
