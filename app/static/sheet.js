// The sheet that is printed: poses, dimensions and errors on one page; layers and the list of parts on a second one.

import { LinkageShape, View, element, make, pathData, text } from "./drawing.js";
import { driveName } from "./drive.js";
import { drawStack } from "./layers.js";
import { fitOf, guideRows, settled } from "./fit.js";
import { nameOf } from "./cards.js";
import { itemOf, placeOf, unitOf, wantsAngles, wantsPlaces } from "./motion.js";
import { RAD } from "./plane.js";
import { $ } from "./shell.js";
import { limitName, mark, reasons } from "./verdict.js";

const SIZE = [720, 400];
const CHART = [720, 120];
const MOST_GHOSTS = 24;

function drawing(fit, motion, drive) {
  const svg = make("svg", { viewBox: `0 0 ${SIZE.join(" ")}`, class: "sheet-drawing" }),
    view = new View(...SIZE);
  const {
      linkage,
      at,
      pass: { sense, low, high },
    } = fit,
    used = linkage.over(sense * low * RAD, sense * high * RAD, 180).filter(Boolean);
  const wanted = wantsPlaces(motion) ? motion.poses.map(placeOf) : [];
  if (!used.length) return svg;
  const parts = drive?.lines() ?? [];
  view.fit([used[0].a, used[0].b, ...used.flatMap((j) => [j.c, j.d, j.p]), ...wanted, ...parts.flat()], 26);
  at.forEach((j, k) => {
    if (j && k % Math.ceil(at.length / MOST_GHOSTS) === 0)
      make("path", { class: "ghost", d: `${pathData([j.d, j.c, j.p].filter(Boolean), view)}Z` }, svg);
  });
  make(
    "path",
    {
      class: "curve",
      d: pathData(
        used.map((j) => j.p ?? j.c),
        view,
      ),
    },
    svg,
  );
  new LinkageShape(svg).show(at[0] ?? used[0], view);
  for (const line of parts) {
    make("path", { class: "drive-rod", d: pathData(line, view) }, svg);
    for (const [cx, cy] of line.map((place) => view.at(place)))
      make("circle", { class: "drive-joint", cx, cy, r: 3.5 }, svg);
  }
  wanted.forEach((place, k) => {
    if (!place) return;
    const [x, y] = view.at(place),
      turn = motion.poses[k].angle;
    make("circle", { class: "wanted", cx: x, cy: y, r: 3 }, svg);
    if (wantsAngles(motion) && turn !== null)
      make(
        "path",
        { class: "wanted", d: `M${x} ${y}l${14 * Math.cos(turn * RAD)} ${-14 * Math.sin(turn * RAD)}` },
        svg,
      );
    make("text", { class: "wanted", x: x - 5, y: y - 7 }, svg).textContent = String(k + 1);
  });
  return svg;
}

/** The transmission angle over the whole used interval. */
function transmission(fit) {
  const svg = make("svg", { viewBox: `0 0 ${CHART.join(" ")}`, class: "sheet-drawing" }),
    {
      linkage,
      pass: { sense, low, high },
    } = fit;
  const left = 34,
    right = CHART[0] - 12,
    top = 8,
    bottom = CHART[1] - 20,
    x = (share) => left + share * (right - left),
    y = (angle) => bottom - (angle / 90) * (bottom - top);
  for (const angle of [0, 30, 60, 90]) {
    make("path", { class: "rule", d: `M${left} ${y(angle)}H${right}` }, svg);
    make("text", { class: "tick", x: left - 5, y: y(angle) + 4, "text-anchor": "end" }, svg).textContent = `${angle}°`;
  }
  for (const share of [0, 0.25, 0.5, 0.75, 1])
    make(
      "text",
      { class: "tick", x: x(share), y: CHART[1] - 5, "text-anchor": share === 1 ? "end" : "middle" },
      svg,
    ).textContent = `${text(sense * (low + share * (high - low)), 4)}${fit.pass.turns ? "°" : ""}`;
  const curve = Array.from({ length: 181 }, (_, k) => [
    k / 180,
    linkage.at(sense * (low + (k / 180) * (high - low)) * RAD),
  ]);
  let d = "",
    pen = "M";
  for (const [share, j] of curve) {
    if (j) d += `${pen}${x(share).toFixed(1)} ${y(j.transmission / RAD).toFixed(1)}`;
    pen = j ? "L" : "M";
  }
  make("path", { class: "curve", d }, svg);
  return svg;
}

function table(head, rows) {
  const made = document.createElement("table"),
    top = made.createTHead().insertRow(),
    body = made.createTBody();
  for (const name of head) top.append(Object.assign(element("th", "", name), { scope: "col" }));
  for (const row of rows) {
    const line = body.insertRow();
    for (const cell of row) line.insertCell().textContent = cell ?? "";
  }
  return made;
}

const number = (value, digits = 6) => (value === null || value === undefined ? "" : text(value, digits));

const PARTS = {
  name: "part",
  material: "material",
  length: "length",
  thickness: "thickness",
  diameter: "diameter",
  holes: "holes",
  tolerance: "tolerance",
  mass: "mass, g",
};

/** The stack from the side, and the list of its parts in millimetres. */
function partsOf(assembly, parts) {
  const section = element("section", "parts"),
    stack = make("svg", { class: "pile" });
  drawStack(stack, assembly);
  const columns = Object.keys(PARTS).filter((name) => parts.some((part) => part[name]));
  section.append(
    element("h3", "", "Layers from the side; parts in mm"),
    stack,
    table(
      columns.map((name) => PARTS[name]),
      parts.map((part) =>
        columns.map((name) =>
          part[name] && !Number.isNaN(Number(part[name])) ? number(Number(part[name]), 5) : part[name],
        ),
      ),
    ),
  );
  return section;
}

/** Fills the sheet with a solution, its drive, {rows(), lines()}, and the list of its parts; without one the page prints as it is. */
export function fillSheet(answer, solution, drive, parts = null) {
  const sheet = $("sheet");
  sheet.replaceChildren();
  document.body.classList.toggle("has-sheet", Boolean(solution));
  if (!solution) return;
  const { motion, request, size } = answer,
    unit = unitOf(motion),
    fit = fitOf(solution, motion),
    { mount, links } = solution,
    item = itemOf(motion),
    verdict = mark(solution.verdict, item);
  const head = element("header", "");
  head.append(
    element("h2", "", links ? "Four-bar linkage" : nameOf(solution).replace(/^\S+ /, "")),
    element(
      "p",
      "",
      `Lengths in ${unit}, angles in degrees, counter-clockwise. ${verdict ? `${verdict.sign} ${verdict.text}.` : "Not judged by the service."}`,
    ),
  );
  const place = (value) => number(settled(value, size));
  const rows = links
    ? Object.entries(links).map(([name, length]) => [name, `${number(length)} ${unit}`])
    : guideRows(solution, number, place, (value) => `${place(value)} ${unit}`);
  if (mount)
    rows.push(["pivot A", mount.pivot_a.map(place).join(", ")], ["pivot B", mount.pivot_b.map(place).join(", ")]);
  if (mount?.coupler_point_polar)
    rows.push([
      "P from D",
      `${number(mount.coupler_point_polar.radius)} ${unit} at ${number(mount.coupler_point_polar.angle, 5)}° from DC`,
    ]);
  rows.push(
    ["branch", solution.branch > 0 ? "+1" : "−1"],
    links
      ? [`crank at ${item} 1`, `${number(solution.start_angle)}° from AB`]
      : [`drive at ${item} 1`, `${place(solution.start)}${fit.pass.turns ? "°" : ` ${unit}`}`],
    ["transmission angle", `${number(solution.transmission_angle_min, 4)}° or more`],
  );
  const held = solution.determination?.active_limits ?? [];
  if (held.length) rows.push(["limited by", held.map(limitName).join(", ")]);
  for (const reason of solution.verdict ? reasons(solution.verdict, item) : []) rows.push(["", reason]);
  if (request.limits?.pivot_box) rows.push(["pivot box", request.limits.pivot_box.map((v) => number(v)).join(", ")]);
  const poses = motion.poses.map((pose, k) => [
    k + 1,
    number(settled(fit.pass.angles[k], fit.pass.high - fit.pass.low), 5),
    number(pose.x),
    number(pose.y),
    wantsAngles(motion) ? number(pose.angle) : "",
    number(fit.places[k] && settled(fit.places[k], size), 3),
    number(fit.turns[k] && settled(fit.turns[k], 57), 3),
    [k === fit.worst.place ? "worst place" : "", k === fit.worst.turn ? "worst angle" : ""].filter(Boolean).join(", "),
  ]);
  const columns = element("div", motion.poses.length > 30 ? "sheet-columns long" : "sheet-columns");
  columns.append(
    table(["Dimension", ""], rows),
    table(
      [
        item,
        fit.pass.turns ? "crank°" : `${solution.driver}, ${unit}`,
        "x",
        "y",
        "angle°",
        `off, ${unit}`,
        "off, °",
        "",
      ],
      poses,
    ),
  );
  const driven = drive?.rows() ?? [];
  if (driven.length) columns.append(table(["Drive", ""], driven));
  sheet.append(
    head,
    drawing(fit, motion, drive),
    columns,
    element("h3", "", `Transmission angle over the ${driveName(solution)} from ${item} 1`),
    transmission(fit),
  );
  if (parts && solution.verdict?.assembly) sheet.append(partsOf(solution.verdict.assembly, parts));
}
