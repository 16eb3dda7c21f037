// Pictures of the machines' replies: the lift in motion, the knotter's verdicts, the service's own drawings.

import { titledChart } from "./charts.js";
import { View, make, pathData, put, roundStep, text } from "./drawing.js";
import { ask } from "./service.js";

function slider(host, count, name, show) {
  const block = document.createElement("label");
  block.className = "field";
  const input = Object.assign(document.createElement("input"), { type: "range", min: 0, max: count - 1, step: 1, value: 0 });
  const said = document.createElement("span");
  block.append(said, input);
  const move = () => { said.textContent = `${name}: ${show(Number(input.value))}`; };
  input.addEventListener("input", move);
  host.append(block);
  move();
}

/** The lift with a slider over time: cylinder O-B, triangle A B C, link D-C, platform on the slide. */
function lift(host, reply) {
  const { points, time, height, velocity } = reply;
  const svg = make("svg", { role: "img", "aria-label": `The lift, rising time ${text(reply.rise_time, 4)} seconds`, viewBox: "0 0 760 420" }, host);
  const view = new View(760, 420);
  const wide = Math.max(...points.A.map(([, y]) => Math.abs(y)), 1) * 0.28;
  view.fit([[0, 0], points.D, ...points.A, ...points.B, ...points.C, [points.D[0] - wide, 0]], 34);
  const [left, right] = [view.world(0, 0)[0], view.world(760, 0)[0]];
  make("path", { class: "axis", d: pathData([[left, 0], [right, 0]], view) }, svg);
  make("path", { class: "ground", d: pathData([points.D, [points.D[0], Math.max(...height) * 1.08]], view) }, svg);
  make("path", { class: "curve turn", d: pathData(points.B, view) }, svg);
  make("path", { class: "curve turn", d: pathData(points.C, view) }, svg);
  const parts = Object.fromEntries([["cylinder", "link crank"], ["link", "link rocker"], ["body", "body"], ["platform", "link rocker"]].map(([name, kind]) => [name, make("path", { class: kind }, svg)]));
  const dots = ["O", "D", "A", "B", "C"].map((name) => [name, make("circle", { class: name === "O" || name === "D" ? "fixed" : "pin", r: 6 }, svg), make("text", { class: "tick" }, svg)]);
  const plots = [];
  const show = (k) => {
    const at = { O: [0, 0], D: points.D, A: points.A[k], B: points.B[k], C: points.C[k] };
    put(parts.cylinder, { d: pathData([at.O, at.B], view) });
    put(parts.link, { d: pathData([at.D, at.C], view) });
    put(parts.body, { d: `${pathData([at.A, at.B, at.C], view)}Z` });
    put(parts.platform, { d: pathData([[at.A[0] - wide, at.A[1]], [at.A[0] + wide, at.A[1]]], view) });
    for (const [name, dot, word] of dots) {
      const [x, y] = view.at(at[name]);
      put(dot, { cx: x, cy: y });
      put(word, { x: x + 10, y: y - 8 });
      word.textContent = name;
    }
    for (const plot of plots) plot.mark(time[k]);
    return `${text(time[k], 4)} s, height ${text(height[k], 5)}, speed ${text(velocity[k], 4)}`;
  };
  slider(host, time.length, "Time", show);
  for (const [title, values] of [["Height over time, seconds", height], ["Speed over time, seconds", velocity]])
    plots.push(titledChart(host, title, { x: time, series: [{ values, colour: "body" }], degreesX: false }));
  show(0);
}

/** A table of the knotter's verdicts over the first two axes; none for more than 400 cells. */
function verdicts(host, reply) {
  const [first, second] = reply.axes;
  const value = (pair, axis) => pair[axis] ?? pair.parameters?.[axis];
  const rows = [...new Set(reply.pairs.map((pair) => value(pair, first)))], columns = [...new Set(reply.pairs.map((pair) => value(pair, second)))];
  if (rows.length * columns.length > 400) return;
  const table = document.createElement("table");
  table.className = "verdicts";
  const caption = table.createCaption();
  caption.className = "note";
  caption.textContent = `Rows vary ${first}, columns ${second}. Where further parameters vary, the combination with the largest margin is shown. The numbers are margins; positive if the condition holds.`;
  const head = table.createTHead().insertRow();
  head.append(Object.assign(document.createElement("th"), { scope: "col", textContent: `${first} \\ ${second}` }));
  for (const column of columns) head.append(Object.assign(document.createElement("th"), { scope: "col", textContent: text(column, 5) }));
  const body = table.createTBody();
  for (const row of rows) {
    const line = body.insertRow();
    line.append(Object.assign(document.createElement("th"), { scope: "row", textContent: text(row, 5) }));
    for (const column of columns) {
      const pairs = reply.pairs.filter((pair) => value(pair, first) === row && value(pair, second) === column);
      const pair = pairs.reduce((a, b) => (b.margin > a.margin ? b : a));
      const cell = line.insertCell();
      cell.className = pair.feasible ? "yes" : "no";
      cell.append(Object.assign(document.createElement("strong"), { textContent: pair.feasible ? "ties" : "fails" }));
      for (const name of ["wrap", "clearance", "bite"]) {
        if (!pair[name]) continue;
        cell.append(`${pair[name].holds ? "✓" : "✗"} ${name} ${text(pair[name].margin, 3)}`, document.createElement("br"));
      }
    }
  }
  const scroll = document.createElement("div");
  scroll.className = "tree";
  scroll.tabIndex = 0;
  scroll.setAttribute("role", "region");
  scroll.setAttribute("aria-label", "Verdicts");
  scroll.append(table);
  host.append(scroll);
}

/** A path in the plane, at the same scale in x and y, over a grid. */
function plane(host, title, xy) {
  const svg = make("svg", { role: "img", "aria-label": title, viewBox: "0 0 760 300" }, host);
  const view = new View(760, 300);
  view.fit(xy, 34);
  const step = roundStep(60 / view.scale), [left, high] = view.world(0, 0), [right, low] = view.world(760, 300);
  let grid = "";
  for (let k = Math.ceil(left / step); k * step <= right; k++) grid += `M${view.x(k * step)} 0V300`;
  for (let k = Math.ceil(low / step); k * step <= high; k++) grid += `M0 ${view.y(k * step)}H760`;
  make("path", { class: "grid", d: grid }, svg);
  make("path", { class: "curve", d: pathData(xy, view) }, svg);
  make("text", { class: "tick", x: 10, y: 18 }, svg).textContent = `grid ${text(step)}`;
}

/** The drawing that the service exports as SVG. */
async function drawn(host, path, request) {
  const content = await (await ask(`${path}.svg`, request)).text();
  const root = new DOMParser().parseFromString(content, "image/svg+xml").documentElement;
  if (root.nodeName !== "svg") return;
  root.setAttribute("role", "img");
  root.setAttribute("aria-label", root.querySelector("title")?.textContent ?? "Drawing");
  root.removeAttribute("width");
  root.removeAttribute("height");
  root.setAttribute("class", "paper");
  host.append(document.importNode(root, true));
}

/** Draws a reply into `host`, by the fields that it has; false if there is nothing to draw. */
export async function picture(host, query, request, reply) {
  host.replaceChildren();
  if (reply.points?.A && reply.time) {
    // curves through few samples have kinks: the picture asks for 201 samples
    lift(host, request.times || reply.time.length >= 101 ? reply : await (await ask(query.path, { ...request, samples: 201 })).json());
  } else if (reply.design && reply.motion && request.cylinder) {
    const design = Object.fromEntries(["l2", "l3", "l4", "l5", "b"].map((name) => [name, reply.design[name]]));
    lift(host, await (await ask(query.path.replace("optimize", "motion"), { design, cylinder: request.cylinder, samples: 101, include: ["points"] })).json());
  } else if (query.exports.includes("svg")) {
    await drawn(host, query.path, request);
    if (reply.slot?.xy) {
      host.append(Object.assign(document.createElement("h3"), { className: "note", textContent: "The slot, larger" }));
      plane(host, "The slot's path", reply.slot.xy);
    }
  } else if (reply.pairs && reply.axes) verdicts(host, reply);
  return host.childElementCount > 0;
}
