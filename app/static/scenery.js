// Scenery around the poses on the canvas: grid, pivot box, way, path and errors, ghosts, body outline, overlay.

import { LinkageShape, make, pathData, pointPath, roundStep, text } from "./drawing.js";
import { itemOf, placeOf, placesOf, wantsAngles, wantsPlaces } from "./motion.js";
import { RAD, add, less, size, times as scaled, turned } from "./plane.js";

const MOST_GHOSTS = 40;

const times = (factor) => (factor < 1e5 ? factor : factor.toExponential(0));

/** Polylines of a body, moved to a place and turned by an angle in radians, as path data. */
function placedOutline(outline, position, turn, view) {
  const placed = (point) => add(position, turned(point, turn));
  return outline.map((line) => pathData(line.map(placed), view)).join("");
}

/** A rectangle of a box [left, bottom, right, top], whose sides that are far away lie just outside the canvas. */
function drawRectangle(kind, [left, bottom, right, top], view, layer) {
  const clip = (value, side) => Math.min(Math.max(value, -9), side + 9),
    [x, x1] = [left, right].map((value) => clip(view.x(value), view.width)),
    [y, y1] = [top, bottom].map((value) => clip(view.y(value), view.height));
  make("rect", { class: kind, x, y, width: x1 - x, height: y1 - y }, layer);
}

export function drawBox(layer, motion, view) {
  layer.replaceChildren();
  if (!motion || !wantsPlaces(motion)) return;
  const { box, extra } = motion.limits;
  for (const zone of extra.keep_out ?? []) drawRectangle("keep-out", zone, view, layer);
  if (extra.envelope) drawRectangle("envelope", extra.envelope, view, layer);
  if (!box) return;
  const [x0, y0] = view.at([box[0], box[3]]),
    [x1, y1] = view.at([box[2], box[1]]),
    [x, y] = [Math.min(x0, x1), Math.min(y0, y1)];
  make("rect", { class: "pivot-box", x, y, width: Math.abs(x1 - x0), height: Math.abs(y1 - y0) }, layer);
  make("text", { class: "tick", x: x + 7, y: y + 16, text: "pivots" }, layer);
  for (const corner of ["0 3", "2 3", "2 1", "0 1"]) {
    const [i, j] = corner.split(" "),
      labelAt = { x: view.x(box[i]) - 5, y: view.y(box[j]) - 5 };
    make("rect", { class: "box-handle", ...labelAt, width: 10, height: 10, rx: 2, "data-corner": corner }, layer);
  }
}

/** The way from pose to pose where the crank angles are free, and `invitation`, what to do on an empty canvas. */
export function drawWay(layer, motion, view, invitation) {
  layer.replaceChildren();
  const targets = placesOf(motion);
  if (invitation) {
    const letter = view.width < 500 ? 15 : 18,
      style = { class: "invite", "font-size": letter, "text-anchor": "middle", "aria-hidden": "true" };
    make("text", { ...style, x: view.width / 2, y: view.height / 2 - letter, text: invitation }, layer);
  }
  if (motion.timing !== "free" || motion.anyOrder || targets.length < 2) return;
  make("path", { class: "way", d: pathData(targets, view) }, layer);
  if (motion.closed && targets.length > 2)
    make("path", { class: "way return", d: pathData([targets.at(-1), targets[0]], view) }, layer);
}

/** The body at each wanted pose: its outline if it has one, else the coupler's triangle of the linkage there. */
export function drawGhosts(layer, motion, linkage, view) {
  layer.replaceChildren();
  const interval = Math.ceil(motion.poses.length / MOST_GHOSTS);
  motion.poses.forEach((pose, k) => {
    if (k % interval) return;
    const position = placeOf(pose),
      joints = linkage?.at[k];
    if (motion.outline && position && wantsPlaces(motion)) {
      const turn = wantsAngles(motion) && pose.angle !== null ? pose.angle * RAD : (joints?.rotation ?? 0);
      make("path", { class: "ghost", d: placedOutline(motion.outline, position, turn, view) }, layer);
    } else if (!motion.outline && joints)
      make("path", { class: "ghost", d: `${pathData([joints.d, joints.c, joints.p].filter(Boolean), view)}Z` }, layer);
  });
}

/** The body's outline where the linkage carries it; null joints remove it. */
export function drawBody(layer, outline, joints, view) {
  layer.replaceChildren();
  if (outline && joints?.p)
    make("path", { class: "outline", d: placedOutline(outline, joints.p, joints.rotation, view) }, layer);
}

/** Other linkages, faint, at their first pose, with their paths. */
export function drawOverlay(layer, curves, view) {
  layer.replaceChildren();
  for (const { at, used } of curves) {
    make("path", { class: "curve", d: pointPath(used, view) }, layer);
    new LinkageShape(layer, false).show(at.find(Boolean) ?? null, view);
  }
}

/** Paths of the body point and the errors at the poses, the worst named; short errors are drawn larger. */
export function drawCurves(curves, targets, { linkage, stale, view, unit }) {
  curves.replaceChildren();
  targets.replaceChildren();
  if (!linkage) return;
  drawBand(curves, targets, linkage.band, view);
  if (linkage.turn) make("path", { class: "curve turn", d: pointPath(linkage.turn, view) }, curves);
  make("path", { class: "curve", d: pointPath(linkage.used, view), "data-curve": "used" }, curves);
  if (!linkage.errors || stale) return;
  const off = linkage.errors.map((pair) => pair && less(pair[1], pair[0])),
    longest = Math.max(0, ...off.filter(Boolean).map(size)),
    pixels = longest * view.scale;
  if (!(pixels > 1e-7)) return;
  const factor = pixels >= 3 ? 1 : roundStep(12 / pixels);
  for (const [k, error] of off.entries()) {
    if (!error) continue;
    const [x, y] = view.at(linkage.errors[k][0]),
      [dx, dy] = scaled(error, view.scale * factor);
    make("path", { class: "miss", d: `M${x} ${y}l${dx} ${-dy}` }, targets);
  }
  const k = linkage.worst.place,
    [cx, cy] = view.at(linkage.errors[k][0]),
    narrow = view.width < 420;
  make("circle", { class: "worst", cx, cy, r: 9, "data-worst": k + 1 }, targets);
  const note = make("text", { class: "miss-note", y: 18, "text-anchor": "end" }, targets),
    worst = `worst: ${itemOf(linkage.motion)} ${k + 1}, ${text(longest, 3)} ${unit};`,
    scale = ` ${narrow ? "" : "errors "}drawn ${factor === 1 ? "to scale" : `${times(factor)} times larger`}`;
  for (const [row, line] of (narrow ? [worst, scale] : [worst + scale]).entries())
    make("tspan", { x: view.width - 10, dy: row ? 16 : 0, text: line }, note);
}

/** The band around the path that 95 % of the linkages made keep to; wider than it is where it would not be seen. */
function drawBand(curves, targets, band, view) {
  const along = band?.filter(Boolean) ?? [],
    widest = Math.max(0, ...along.map(([, radius]) => radius)) * view.scale;
  if (along.length < 2 || !(widest > 1e-7)) return;
  const factor = widest >= 3 ? 1 : roundStep(5 / widest),
    points = along.map(([point]) => view.at(point));
  const edge = (side) =>
    along.map(([, radius], k) => {
      const [dx, dy] = less(points[Math.min(along.length - 1, k + 1)], points[Math.max(0, k - 1)]),
        far = (side * radius * view.scale * factor) / (Math.hypot(dx, dy) || 1);
      return add(points[k], [far * dy, -far * dx]);
    });
  const wider = factor === 1 ? "" : `, drawn ${times(factor)} times wider`,
    at = { class: "band-note", x: view.width - 10, y: 36, "text-anchor": "end" };
  make("path", { class: "band", d: `${pathData([...edge(-1), ...edge(1).reverse()])}Z` }, curves);
  make("text", { ...at, text: `95 % of the manufactured linkages are within the band${wider}` }, targets);
}
