// What lies around the poses on the canvas: grid, pivot box, way, path and errors, ghosts, body outline, overlay.

import { LinkageShape, make, pathData, roundStep, text } from "./drawing.js";
import { itemOf, placeOf, placesOf, wantsAngles, wantsPlaces } from "./motion.js";
import { RAD } from "./plane.js";

const MOST_GHOSTS = 40;

const times = (factor) => (factor < 1e5 ? factor : factor.toExponential(0));

/** Polylines of a body, moved to a place and turned by an angle in radians, as path data. */
function placedOutline(outline, [x, y], turn, view) {
  const cosine = Math.cos(turn),
    sine = Math.sin(turn);
  return outline
    .map((line) =>
      pathData(
        line.map(([u, v]) => [x + cosine * u - sine * v, y + sine * u + cosine * v]),
        view,
      ),
    )
    .join("");
}

/** Draws the grid into `layer`; returns its step. */
export function drawGrid(layer, view) {
  layer.replaceChildren();
  const step = roundStep(56 / view.scale);
  const [left, high] = view.world(0, 0),
    [right, low] = view.world(view.width, view.height);
  let minor = "",
    axis = "";
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const name = (value) => (Math.abs(value) >= 1e6 || digits > 5 ? text(value, 4) : value.toFixed(Math.min(digits, 20)));
  for (let k = Math.ceil(left / step); k <= right / step && layer.childElementCount < 400; k++) {
    const x = Math.round(view.x(k * step)) + 0.5;
    if (k === 0) axis += `M${x} 0V${view.height}`;
    else minor += `M${x} 0V${view.height}`;
    if (x > 34 && x < view.width - 14)
      make(
        "text",
        { class: "tick", x, y: view.height - 6, "text-anchor": "middle", "aria-hidden": "true" },
        layer,
      ).textContent = name(k * step);
  }
  for (let k = Math.ceil(low / step); k <= high / step && layer.childElementCount < 800; k++) {
    const y = Math.round(view.y(k * step)) + 0.5;
    if (k === 0) axis += `M0 ${y}H${view.width}`;
    else minor += `M0 ${y}H${view.width}`;
    if (y > 14 && y < view.height - 22)
      make("text", { class: "tick", x: 5, y: y - 3, "aria-hidden": "true" }, layer).textContent = name(k * step);
  }
  layer.prepend(make("path", { class: "grid", d: minor }), make("path", { class: "axis", d: axis }));
  return step;
}

export function drawBox(layer, motion, view) {
  layer.replaceChildren();
  if (!motion || !wantsPlaces(motion)) return;
  const {
    box,
    extra: { keep_out: zones = [], envelope },
  } = motion.limits;
  const kinds = [...(zones ?? []).map((zone) => ["keep-out", zone]), ...(envelope ? [["envelope", envelope]] : [])];
  for (const [name, zone] of kinds) {
    // sides that are far away lie just outside the canvas
    const [x0, y0, x1, y1] = [...view.at([zone[0], zone[3]]), ...view.at([zone[2], zone[1]])].map((one, k) =>
      Math.min(Math.max(one, -9), (k % 2 ? view.height : view.width) + 9),
    );
    make("rect", { class: name, x: x0, y: y0, width: x1 - x0, height: y1 - y0 }, layer);
  }
  if (!box) return;
  const [x0, y0] = view.at([box[0], box[3]]),
    [x1, y1] = view.at([box[2], box[1]]);
  make(
    "rect",
    {
      class: "pivot-box",
      x: Math.min(x0, x1),
      y: Math.min(y0, y1),
      width: Math.abs(x1 - x0),
      height: Math.abs(y1 - y0),
    },
    layer,
  );
  make("text", { class: "tick", x: Math.min(x0, x1) + 7, y: Math.min(y0, y1) + 16 }, layer).textContent = "pivots";
  for (const [x, y, i, j] of [
    [x0, y0, 0, 3],
    [x1, y0, 2, 3],
    [x1, y1, 2, 1],
    [x0, y1, 0, 1],
  ])
    make(
      "rect",
      { class: "box-handle", x: x - 5, y: y - 5, width: 10, height: 10, rx: 2, "data-corner": `${i} ${j}` },
      layer,
    );
}

/** The way from pose to pose where the crank angles are free, and `invitation`, what to do on an empty canvas. */
export function drawWay(layer, motion, view, invitation) {
  layer.replaceChildren();
  const places = placesOf(motion);
  if (invitation) {
    const size = view.width < 500 ? 15 : 18;
    make(
      "text",
      {
        class: "invite",
        x: view.width / 2,
        y: view.height / 2 - size,
        "font-size": size,
        "text-anchor": "middle",
        "aria-hidden": "true",
      },
      layer,
    ).textContent = invitation;
  }
  if (motion.timing !== "free" || motion.anyOrder || places.length < 2) return;
  make("path", { class: "way", d: pathData(places, view) }, layer);
  if (motion.closed && places.length > 2)
    make("path", { class: "way return", d: pathData([places.at(-1), places[0]], view) }, layer);
}

/** The body at each wanted pose: its outline where it has one, else the coupler's triangle where the linkage has it there. */
export function drawGhosts(layer, motion, linkage, view) {
  layer.replaceChildren();
  const every = Math.ceil(motion.poses.length / MOST_GHOSTS);
  motion.poses.forEach((pose, k) => {
    if (k % every) return;
    const place = placeOf(pose),
      joints = linkage?.at[k];
    if (motion.outline && place && wantsPlaces(motion)) {
      const turn = wantsAngles(motion) && pose.angle !== null ? pose.angle * RAD : (joints?.rotation ?? 0);
      make("path", { class: "ghost", d: placedOutline(motion.outline, place, turn, view) }, layer);
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
export function drawOverlay(layer, others, view) {
  layer.replaceChildren();
  for (const { at, used } of others) {
    make(
      "path",
      {
        class: "curve",
        d: pathData(
          used.map((j) => j && (j.p ?? j.c)),
          view,
        ),
      },
      layer,
    );
    new LinkageShape(layer, false).show(at.find(Boolean) ?? null, view);
  }
}

/** Paths of the body point and the errors at the poses, the worst named; errors too short to be seen are drawn larger. */
export function drawCurves(curves, targets, { linkage, stale, view, unit }) {
  curves.replaceChildren();
  targets.replaceChildren();
  if (!linkage) return;
  drawBand(curves, targets, linkage.band, view);
  const way = (list) =>
    pathData(
      list.map((j) => j && (j.p ?? j.c)),
      view,
    );
  if (linkage.turn) make("path", { class: "curve turn", d: way(linkage.turn) }, curves);
  make("path", { class: "curve", d: way(linkage.used), "data-curve": "used" }, curves);
  if (!linkage.errors || stale) return;
  const longest = Math.max(
    0,
    ...linkage.errors.filter(Boolean).map(([from, to]) => Math.hypot(to[0] - from[0], to[1] - from[1])),
  );
  const pixels = longest * view.scale;
  if (!(pixels > 1e-7)) return;
  const factor = pixels >= 3 ? 1 : roundStep(12 / pixels);
  for (const pair of linkage.errors) {
    if (!pair) continue;
    const [x, y] = view.at(pair[0]),
      go = [0, 1].map((i) => (pair[1][i] - pair[0][i]) * view.scale * factor);
    make("path", { class: "miss", d: `M${x} ${y}l${go[0]} ${-go[1]}` }, targets);
  }
  const k = linkage.worst.place,
    [x, y] = view.at(linkage.errors[k][0]);
  make("circle", { class: "worst", cx: x, cy: y, r: 9, "data-worst": k + 1 }, targets);
  const note = make("text", { class: "miss-note", y: 18, "text-anchor": "end" }, targets),
    narrow = view.width < 420;
  const told = [
    `worst: ${itemOf(linkage.motion)} ${k + 1}, ${text(longest, 3)} ${unit};`,
    ` ${narrow ? "" : "errors "}drawn ${factor === 1 ? "to scale" : `${times(factor)} times larger`}`,
  ];
  const lines = narrow ? told : [told.join("")];
  lines.forEach((line, row) => {
    make("tspan", { x: view.width - 10, dy: row ? 16 : 0 }, note).textContent = line;
  });
}

/** The band around the path that 95 % of the linkages made keep to; wider than it is where it would not be seen. */
function drawBand(curves, targets, band, view) {
  const along = band?.filter(Boolean) ?? [];
  const widest = Math.max(0, ...along.map(([, radius]) => radius)) * view.scale;
  if (along.length < 2 || !(widest > 1e-7)) return;
  const factor = widest >= 3 ? 1 : roundStep(5 / widest);
  const edges = [[], []];
  along.forEach(([place, radius], k) => {
    const [x, y] = view.at(place),
      [x0, y0] = view.at(along[Math.max(0, k - 1)][0]),
      [x1, y1] = view.at(along[Math.min(along.length - 1, k + 1)][0]);
    const length = Math.hypot(x1 - x0, y1 - y0) || 1,
      far = radius * view.scale * factor;
    for (const side of [0, 1])
      edges[side].push([
        x + ((side ? 1 : -1) * far * (y1 - y0)) / length,
        y - ((side ? 1 : -1) * far * (x1 - x0)) / length,
      ]);
  });
  const outline = [...edges[0], ...edges[1].reverse()].map(([x, y]) => `${x.toFixed(2)} ${y.toFixed(2)}`);
  make("path", { class: "band", d: `M${outline.join("L")}Z` }, curves);
  make("text", { class: "band-note", x: view.width - 10, y: 36, "text-anchor": "end" }, targets).textContent =
    `95 % of those made are within the band${factor === 1 ? "" : `, drawn ${times(factor)} times wider`}`;
}
