// The chain's page: the chain in motion on its track with wheels and slot, the slot enlarged, and what wear does to it.

import { curves, facts, note, table } from "./answer.js";
import { make, put } from "./drawing.js";
import { seldom } from "./play.js";
import { dot, grid, line, stage, symbol } from "./stage.js";

const MOST_PINS = 60_000; // listed in an answer to a drawing
const FEWEST = 46; // samples of a drawing: steps of two degrees of P1 on a wheel of four pins
const USUAL = 91; // samples, unless the request says another
const PARTS = {
  left_wheel: ["crank", "orange"],
  lower_arc: ["body", "blue"],
  right_wheel: ["path", "green"],
  upper_arc: ["pose", "red"],
};
const UNIT = "All lengths are in the unit of the pitch.";

/** SVG path data of a closed contour of rows x, y, bulge: the tangent of a quarter of the turn to the next row. */
function contour(rows, view) {
  const short = (value) => Math.round(value * 100) / 100,
    place = ([x, y]) => `${short(view.x(x))} ${short(view.y(y))}`;
  return `M${place(rows[0])}${rows
    .map(([x, y, bulge], k) => {
      const next = rows[(k + 1) % rows.length],
        turn = 4 * Math.atan(bulge);
      if (!bulge) return `L${place(next)}`;
      const radius = short((view.scale * Math.hypot(next[0] - x, next[1] - y)) / (2 * Math.sin(Math.abs(turn) / 2)));
      return `A${radius} ${radius} 0 ${Math.abs(turn) > Math.PI ? 1 : 0} ${turn > 0 ? 0 : 1} ${place(next)}`;
    })
    .join("")}Z`;
}

/** All pins at a phase between two samples, each [x, y]. */
function pinsAt(phases, rows) {
  const [first, last] = [phases[0], phases.at(-1)];
  return (phase) => {
    const at = Math.min(Math.max((phase - first) / (last - first), 0), 1) * (phases.length - 1),
      k = Math.min(Math.floor(at), phases.length - 2);
    return rows[k].map(([x, y], pin) => {
      const [u, v] = rows[k + 1][pin];
      return [x + (at - k) * (u - x), y + (at - k) * (v - y)];
    });
  };
}

const clip = (name) => name.replace("_", " ");

/** The wheels of the crescent: centres, and a pin whose angle turns each. */
function wheels({ geometry: g }, unit) {
  const eps = unit === "rad" ? g.epsilon : (g.epsilon * Math.PI) / 180,
    c = g.upper_radius + g.wheel_radius;
  const spokes = Math.round((unit === "rad" ? 2 * Math.PI : 360) / g.delta_wheel);
  return [-1, 1].map((side) => ({
    centre: [side * c * Math.cos(eps), c * Math.sin(eps)],
    radius: g.wheel_radius,
    spokes,
  }));
}

/** Pins that lie on a wheel turn it: its spokes lead to the first of them. */
function turnWheel(path, wheel, pins, view) {
  const on = pins.find(
    ([x, y]) => Math.abs(Math.hypot(x - wheel.centre[0], y - wheel.centre[1]) - wheel.radius) < 1e-3 * wheel.radius,
  );
  if (!on) return;
  const start = Math.atan2(on[1] - wheel.centre[1], on[0] - wheel.centre[0]);
  let data = "";
  for (let k = 0; k < wheel.spokes; k++) {
    const angle = start + (2 * Math.PI * k) / wheel.spokes;
    data += `M${view.x(wheel.centre[0])} ${view.y(wheel.centre[1])}L${view.x(wheel.centre[0] + wheel.radius * Math.cos(angle))} ${view.y(wheel.centre[1] + wheel.radius * Math.sin(angle))}`;
  }
  put(path, { d: data });
}

const middle = (list) => list[Math.floor(list.length / 2)];

/** Track, groove, wheels and links; returns a function that draws them into a layer. */
function machine(reply, phases, at) {
  const { slot: made, pins, outline, geometry } = reply,
    turning = geometry ? wheels(reply, reply.angle_unit) : [],
    free = made.free_pin - 1;
  return (layer, view) => {
    grid(layer, view);
    for (const wheel of turning)
      make(
        "circle",
        { class: "wheel", cx: view.x(wheel.centre[0]), cy: view.y(wheel.centre[1]), r: wheel.radius * view.scale },
        layer,
      );
    for (const wall of [outline?.left, outline?.right])
      if (wall) make("path", { class: "wall", d: contour(wall, view) }, layer);
    if (outline) make("path", { class: "ground", d: contour(outline.path, view) }, layer);
    line(layer, "curve", made.xy, view);
    const arms = turning.map(() => make("path", { class: "wheel" }, layer)),
      chain = line(layer, "link crank thin", null, null, true);
    const dots = pins.xy[0].map((_, k) => dot(layer, k === free ? "point" : "pin", k === free ? 6 : 4));
    const low = middle(made.xy);
    const names = [
      [0, "P1"],
      [free, `P${made.free_pin}`],
    ].map(([pin, name]) => [pin, symbol(layer, name)]);
    const still = [["slot", low, -48, 26]];
    if (geometry) {
      for (const wheel of turning) {
        dot(layer, "fixed", 4)(wheel.centre, view);
        still.push(["R0", wheel.centre, 8, 16]);
      }
      for (const [name, place] of [
        ["O1", [0, 0]],
        ["O2", [0, geometry.eccentricity]],
      ]) {
        dot(layer, "fixed", 3)(place, view);
        still.push([name, place, 8, -4]);
      }
      still.push(
        ["R1", [geometry.upper_radius * Math.cos(-2.2), geometry.upper_radius * Math.sin(-2.2)], -26, 0],
        [
          "R2",
          [geometry.lower_radius * Math.cos(-2), geometry.eccentricity + geometry.lower_radius * Math.sin(-2)],
          -8,
          20,
        ],
      );
    }
    const stay = still.map(([name, ...where]) => [symbol(layer, name), where]);
    return (phase) => {
      const places = at(phase);
      chain(places, view);
      dots.forEach((move, k) => move(places[k], view));
      turning.forEach((wheel, k) => turnWheel(arms[k], wheel, places, view));
      for (const [pin, move] of names) move(places[pin], view);
      for (const [move, [place, ...off]] of stay) move(place, view, ...off);
    };
  };
}

/** The slot enlarged, its bare arc and walls, with the free pin and its neighbours. */
function closeUp(host, reply, at) {
  const { slot: made, outline } = reply,
    xs = made.xy.map(([x]) => x),
    ys = made.xy.map(([, y]) => y),
    free = made.free_pin - 1;
  const box = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)],
    room = 0.06 * Math.max(box[1] - box[0], box[3] - box[2]);
  let move = null;
  stage(host, {
    label: `The slot of pin P${made.free_pin}, enlarged`,
    extent: [
      [box[0] - room, box[2] - room],
      [box[1] + room, box[3] + room],
    ],
    draw(layer, view) {
      grid(layer, view);
      for (const wall of [outline?.left, outline?.right])
        if (wall) make("path", { class: "wall", d: contour(wall, view) }, layer);
      if (reply.geometry)
        make(
          "circle",
          { class: "bare", cx: view.x(0), cy: view.y(0), r: reply.geometry.upper_radius * view.scale },
          layer,
        );
      line(layer, "curve", made.xy, view);
      const links = line(layer, "link crank thin"),
        pin = dot(layer, "point", 7),
        name = symbol(layer, `P${made.free_pin}`);
      if (reply.geometry) symbol(layer, "R1")(made.xy[Math.round(made.xy.length / 5)], view, 4, -18);
      move = (phase) => {
        const places = at(phase),
          count = places.length;
        links([places[(free + count - 1) % count], places[free], places[(free + 1) % count]], view);
        pin(places[free], view);
        name(places[free], view, 10, 20);
      };
      return move;
    },
  });
  return (phase) => move(phase);
}

function powers(host, fit, unit) {
  const rows = (fit?.power?.pieces ?? []).flatMap((piece, k) =>
    ["x", "y"].map((axis) => [`${k + 1} ${axis}`, ...(piece.theta1 ?? piece.position ?? [null, null]), ...piece[axis]]),
  );
  if (!rows.length) return;
  const most = Math.max(...rows.map((row) => row.length)) - 3;
  table(
    host,
    "The fitted slot by powers of t, 0 to 1 over each piece",
    ["piece", { name: "from", unit }, { name: "to", unit }, ...Array.from({ length: most }, (_, k) => `t^${k}`)],
    rows.map((row) => [...row, ...Array(most + 3 - row.length).fill(null)]),
  );
}

/** An answer, and what is drawn of it: `drawn`, the same with pins and outline. */
function slot(reply, drawn, hosts) {
  const angle = reply.angle_unit === "rad" ? "rad" : "°",
    { slot: made, checks, geometry } = reply,
    { pins, outline } = drawn,
    phases = drawn.slot.theta1 ?? drawn.slot.position;
  const unit = made.theta1 ? angle : "",
    name = made.theta1 ? "θ1" : "way of P1";
  facts(hosts.facts, [
    ["status", reply.status],
    ["depth of the slot", made.depth_max],
    ["smallest curvature radius", made.radius_min],
    ["step at the slot's ends", made.end_step],
    ["largest slack", Math.max(...made.slack)],
    ["largest chord error", checks.chord_error_max],
    ["stretched", checks.stretched],
    ["roller fits", checks.roller_fits],
  ]);
  if (geometry)
    facts(
      hosts.facts,
      [
        ["R0", geometry.wheel_radius],
        ["R1", geometry.upper_radius],
        ["R2", geometry.lower_radius],
        ["b", geometry.eccentricity],
        ["ξ", geometry.xi, angle],
        ["α", geometry.alpha, angle],
        ["start of the window", geometry.phase_start, angle],
        ["wheels out of phase by", reply.wheel_phase_conflict, angle],
      ],
      "Layout",
    );
  if (reply.fit)
    facts(
      hosts.facts,
      [
        ["kind", `${reply.fit.kind}, order ${reply.fit.order}`],
        ["error square to the slot", reply.fit.max_normal],
        ["error of a link", reply.fit.max_chord],
        ["error by powers", reply.fit.power?.max_normal],
      ],
      "Fit",
    );
  note(hosts.facts, UNIT);
  table(
    hosts.tables,
    "Pins that pass a joint: the slot's curvature jumps",
    [{ name, unit }, "pin", "onto"],
    reply.crossings.map((one) => [
      one.theta1 ?? one.position,
      `P${one.pin}`,
      one.to ? clip(one.to) : `segment ${one.to_segment}`,
    ]),
  );
  powers(hosts.tables, reply.fit, unit);
  const marks = [
    curves(hosts.curves, {
      x: made.theta1 ?? made.position,
      xUnit: unit,
      list: [{ title: "Slack at the free pin", values: made.slack, colour: "path" }],
    }),
  ];
  if (pins?.theta) {
    const of = (pin, part) => pins.theta.map((row, j) => (pins.segment[j][pin] === part ? row[pin] : null));
    const series = pins.theta[0].flatMap((_, k) =>
      pins.segments.map((part, n) => ({
        values: of(k, n),
        colour: PARTS[part][0],
        width: k + 1 === made.free_pin ? 3 : 1.4,
      })),
    );
    const title = `Angles θ1 … θ${reply.links} of the pins on the ${pins.segments.map((part) => `${clip(part)} (${PARTS[part][1]})`).join(", ")}, ${angle}; thick: P${made.free_pin}`;
    marks.push(
      curves(hosts.curves, {
        x: phases,
        xUnit: unit,
        list: [{ title, height: 320, series: series.filter(({ values }) => values.some((value) => value !== null)) }],
      }),
    );
  }
  const mark = (phase) => marks.forEach((one) => one(phase));
  const at = pinsAt(phases, pins.xy),
    draw = machine(drawn, phases, at),
    extent = [...pins.xy[0], ...(outline.right ?? outline.path)];
  const follow = [seldom(mark)];
  const run = stage(hosts.picture, {
    label: `A chain of ${reply.links} links on its track; pin P${made.free_pin} hangs in the slot`,
    extent,
    draw,
    play: {
      name: made.theta1 ? "Angle of P1" : "Way of P1",
      from: phases[0],
      to: phases.at(-1),
      seconds: 3,
      round: true,
    },
    words: (phase) => `${made.theta1 ? "θ1" : "P1"} ${phase.toFixed(unit === "rad" ? 4 : 2)}${unit}`,
    follow: (phase) => follow.forEach((one) => one(phase)),
  });
  follow.push(closeUp(hosts.picture, drawn, at));
  run.go(run.value);
  return run;
}

function tolerance({ reply }, hosts) {
  const { tolerance: made } = reply,
    errors = reply.wear.map((row) => row.pitch_error),
    column = (name) => reply.wear.map((row) => row[name]);
  facts(hosts.facts, [
    ["layout within its tolerances", reply.status],
    ["just stretched at a pitch error of", reply.pitch_error_min],
    ["least slack over the corners", made.slack_min],
    ["largest slack over the corners", made.slack_max],
    ["corners", made.corners],
    ["nominal slack", [reply.slack_min, reply.slack_max]],
  ]);
  note(hosts.facts, UNIT);
  if (errors.length > 1 && errors.every((error, k) => !k || error > errors[k - 1]))
    curves(hosts.curves, {
      x: errors,
      list: [
        {
          title: "Slack over the pitch error, least and largest",
          series: [
            { values: column("slack_max"), colour: "path" },
            { values: column("slack_min"), colour: "crank" },
          ],
        },
        { title: "Free pin past the slot, at most", values: column("beyond_slot"), colour: "body" },
      ],
    });
  table(
    hosts.tables,
    "Pitch wear",
    ["pitch error", "least slack", "largest slack", "stretched", "depth of the free pin", "past the slot"],
    reply.wear.map((row) => Object.values(row)),
  );
  table(
    hosts.tables,
    "Change of the least slack",
    ["length", "per unit"],
    Object.entries(made.sensitivity).map(([name, value]) => [clip(name), value]),
  );
  return null;
}

/** A question as its drawing needs it. */
const drawable = (request, samples) => ({ ...request, samples, include: ["pins", "outline"] });

export const chain = {
  request(query, request) {
    if (query.path === "/v2/chain/tolerance") return request;
    const samples = Math.max(request.samples ?? USUAL, FEWEST);
    return samples * (request.links ?? 200) > MOST_PINS ? request : drawable(request, samples);
  },
  numbers: ({ pins, outline, ...reply }) => reply,
  async show({ query, request, reply, ask }, hosts) {
    if (query.path === "/v2/chain/tolerance") return tolerance({ reply }, hosts);
    return slot(
      reply,
      reply.pins && reply.outline
        ? reply
        : await ask(
            query.path,
            drawable(
              { ...request, fit: null, power_decimals: null },
              Math.min(USUAL, Math.floor(MOST_PINS / reply.links)),
            ),
          ),
      hosts,
    );
  },
};
