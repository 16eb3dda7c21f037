// The knotter's page: disc, bill, jaw and rope in space over the bill's angle, the crossings in their planes, the verdicts.

import { curves, facts, note, table } from "./answer.js";
import { put, text } from "./drawing.js";
import { seldom } from "./play.js";
import { build } from "./shell.js";
import { along, circle, Projection } from "./space.js";
import { dot, grid, line, stage, symbol } from "./stage.js";

const MOST_CELLS = 400;
const FAR = 2.2; // sizes of a triangle within which a crossing is drawn
const CONDITIONS = ["wrap", "clearance", "bite"];
const degree = (unit) => (unit === "rad" ? "rad" : "°");

/** What a verdict means, in words. */
function sentence(name, part, unit) {
  const margin = `${text(Math.abs(part.margin), 4)} mm ${part.holds ? "to spare" : "short"}`;
  if (name === "clearance")
    return part.holds
      ? `S10 keeps clear of the disc, ${margin} at ${text(part.worst_angle, 6)}${unit}`
      : `S10 meets the disc's plane, ${margin} at ${text(part.worst_angle, 6)}${unit}`;
  const rope =
    name === "wrap"
      ? ["The rope wraps over S3S4", "The rope does not wrap"]
      : ["The jaw bites the rope over S8S9", "The jaw does not bite the rope"];
  if (part.angle === null)
    return `${rope[1]}: it never enters the triangle, ${margin} at ${text(part.nearest_angle, 6)}${unit}`;
  const where = `at ${text(part.angle, 6)}${unit}${part.edge ? ` through ${part.edge}` : ""}`;
  return part.holds ? `${rope[0]} ${where}, ${margin}` : `${rope[1]}: it enters ${where}, ${margin}`;
}

function verdict(host, reply, unit) {
  const list = build("ul", { className: "verdicts-list" });
  for (const name of CONDITIONS) {
    const part = reply[name],
      row = build("li", { className: part.holds ? "yes" : "no" });
    row.append(
      build("strong", { textContent: `${part.holds ? "✓" : "✗"} ${name}: ` }),
      `${sentence(name, part, unit)}.`,
    );
    list.append(row);
  }
  host.append(list);
}

/** Every path of a reply at a bill angle between two samples. */
function places({ alpha, paths }) {
  const [first, last] = [alpha[0], alpha.at(-1)];
  return (at) => {
    const share = Math.min(Math.max((at - first) / (last - first), 0), 1) * (alpha.length - 1),
      k = Math.min(Math.floor(share), alpha.length - 2);
    return Object.fromEntries(
      Object.entries(paths).map(([name, path]) => [name, along(path[k], path[k + 1], share - k)]),
    );
  };
}

const ends = (edge) => edge.match(/[A-Z]\d+/g);

/** The mechanism in space; returns its player. */
function space(host, reply, unit, follow) {
  const at = places(reply),
    seen = new Projection(),
    { axes, paths } = reply,
    turn = unit === "rad" ? 2 * Math.PI : 360;
  const rim = axes ? circle(paths.S0[0], axes.disc) : paths.S0,
    every = Object.values(paths).flat().concat(rim);
  const centre = [0, 1, 2].map((k) => (Math.min(...every.map((p) => p[k])) + Math.max(...every.map((p) => p[k]))) / 2);
  const reach = Math.max(...every.map((p) => Math.hypot(...p.map((x, k) => x - centre[k]))));
  const flat = (point) => {
    const [x, y] = seen.at(point.map((value, k) => value - centre[k]));
    return [x, y];
  };
  const enters = (part, name) =>
    part.angle !== null && part.edge ? { name, ends: ends(part.edge), share: part.fraction, holds: part.holds } : null;
  const entries = [enters(reply.wrap, "E1"), enters(reply.bite, "E2")].filter(Boolean);
  const phase = (alpha) => ((alpha % turn) + turn) % turn;
  const run = stage(host, {
    label: `The knotter at alpha1 ${text(reply.alpha1, 5)}, alpha3 ${text(reply.alpha3, 5)}: disc, bill, jaw and rope in space`,
    extent: [
      [-0.8 * reach, -0.6 * reach],
      [0.8 * reach, 0.6 * reach],
    ],
    play: { name: "Bill angle alpha", from: reply.alpha[0], to: reply.alpha.at(-1), seconds: 6, round: true },
    words: (alpha) => `alpha ${alpha.toFixed(unit === "rad" ? 3 : 1)}${unit}`,
    follow,
    draw(layer, view) {
      const axis = axes ? Object.entries(axes).map(([name, two]) => [name, line(layer, "axis"), two]) : [];
      const disc = line(layer, "disc"),
        swept = line(layer, "curve turn"),
        bill = line(layer, "body", null, null, true),
        jaw = line(layer, "jaw", null, null, true);
      const [wrapped, bitten] = [line(layer, "edge bill"), line(layer, "edge jaws")],
        hinge = line(layer, "bare");
      const ropes = [
          ["S1", line(layer, "rope")],
          ["S7", line(layer, "rope")],
        ],
        dots = ["S0", "S1", "S7", "S10"].map((name) => [name, dot(layer, name === "S0" ? "fixed" : "pin", 5)]);
      const marks = entries.map((one) => [
        one,
        dot(layer, one.holds ? "enter" : "enter wrong", 9),
        symbol(layer, one.name),
      ]);
      const names = ["S0", "S1", "S3", "S4", "S7", "S8", "S9", "S10"].map((name) => [name, symbol(layer, name)]);
      const ways = axis.map(([name]) => symbol(layer, { shaft: "i1", disc: "j2", bill: "k0" }[name])),
        drawn = layer.querySelectorAll(".rope");
      return (alpha) => {
        const now = at(alpha),
          lie = (list) => list.map((name) => flat(now[name]));
        const tips = axis.map(([, lay, [start, end]]) => {
          const two = [-1.1, 1.1].map((share) => flat(along(start, end, share * reach * 0.5)));
          lay(two, view);
          return two[1];
        });
        disc(rim.map(flat), view);
        swept(paths.S10.map(flat), view);
        bill(lie(["S3", "S4", "S5"]), view);
        jaw(lie(["O5", "S8", "S9"]), view);
        wrapped(lie(["S3", "S4"]), view);
        bitten(lie(["S8", "S9"]), view);
        hinge(lie(["S5", "O5"]), view);
        const biting = phase(alpha) > turn / 2;
        ropes.forEach(([name, rope], k) => {
          rope(lie(["S0", name]), view);
          put(drawn[k], { class: biting === Boolean(k) ? "rope" : "rope idle" });
        });
        for (const [name, place] of dots) place(flat(now[name]), view);
        for (const [one, place, name] of marks) {
          const spot = flat(along(now[one.ends[0]], now[one.ends[1]], one.share));
          place(spot, view);
          name(spot, view, 12, 14);
        }
        for (const [name, place] of names) place(flat(now[name]), view);
        ways.forEach((name, k) => name(tips[k], view, 4, -4));
      };
    },
  });
  seen.control(host, host.querySelector("svg.stage"), () => run.go(run.value));
  return run;
}

/** The crossing in the plane of its triangle (figure 9 of the source), with its way over the bill's angle. */
function plane(host, reply, name, [right, up], told, steps) {
  const { point, on_rope: on, corners, frame, triangle } = reply[name],
    at = (p) => [p[right], p[up]],
    axis = "ijk";
  const near = told.angle ?? told.nearest_angle,
    closest = reply.alpha.reduce(
      (best, value, k) => (Math.abs(value - near) < Math.abs(reply.alpha[best] - near) ? k : best),
      0,
    );
  const shape = corners[closest].map(at),
    every = corners.flat().map(at),
    size = Math.max(...shape.flatMap((p) => shape.map((q) => Math.hypot(p[0] - q[0], p[1] - q[1]))));
  const mid = [0, 1].map((k) => shape.reduce((sum, p) => sum + p[k], 0) / 3);
  const way = point.map((p, k) =>
    p && on[k] && Math.hypot(p[right] - mid[0], p[up] - mid[1]) < FAR * size ? at(p) : null,
  );
  let move = () => {};
  stage(host, {
    label: `${name} in the plane ${axis[right]} ${axis[up]} of ${frame}`,
    extent: every.map((p) => [p[0] + 0.12 * (p[0] - mid[0]), p[1] + 0.12 * (p[1] - mid[1])]),
    draw(layer, view) {
      grid(layer, view, "mm");
      const body = line(layer, name === "E1" ? "body" : "jaw", null, null, true);
      line(layer, "curve", way, view);
      const edge = line(layer, name === "E1" ? "edge bill" : "edge jaws"),
        now = dot(layer, "point", 6);
      if (steps?.point) {
        dot(layer, "pin", 4)(at(steps.point), view);
        symbol(layer, "before")(at(steps.point), view, -56, 5);
      }
      if (told.point) {
        dot(layer, told.holds ? "enter" : "enter wrong", 9)(at(told.point), view);
        symbol(layer, name)(at(told.point), view, 12, 4);
      }
      const names = triangle.map((one) => symbol(layer, one));
      move = (alpha) => {
        const share = ((alpha - reply.alpha[0]) / (reply.alpha.at(-1) - reply.alpha[0])) * (reply.alpha.length - 1),
          k = Math.min(reply.alpha.length - 1, Math.max(0, Math.round(share)));
        const held = corners[k].map(at);
        body(held, view);
        edge(name === "E1" ? [held[0], held[1]] : [held[1], held[2]], view);
        names.forEach((lay, n) => lay(held[n], view, n === 2 ? -24 : 9, n === 2 ? 14 : -8));
        if (way[k]) now(way[k], view);
        put(layer.querySelector("circle.point"), { visibility: way[k] ? "visible" : "hidden" });
      };
      move(near);
      return move;
    },
  });
  return (alpha) => move(alpha);
}

function pair({ reply, request }, hosts) {
  const unit = degree(request.angle_unit),
    follow = [];
  const run = space(hosts.picture, reply, unit, (alpha) => follow.forEach((one) => one(alpha)));
  verdict(hosts.picture, reply, unit);
  const planes = build("div", { className: "planes" }),
    halves = [0, 1].map(() => document.createElement("div"));
  planes.append(...halves);
  hosts.picture.append(planes);
  for (const [name, sides, part, steps] of [
    ["E1", [1, 2], reply.wrap, reply.step_before],
    ["E2", [0, 2], reply.bite, null],
  ])
    follow.push(plane(halves[name === "E1" ? 0 : 1], reply, name, sides, part, steps));
  facts(hosts.facts, [
    ["status", reply.status],
    ["alpha1", reply.alpha1, unit],
    ["alpha3", reply.alpha3, unit],
    ...CONDITIONS.map((name) => [`margin of the ${name}`, reply[name].margin, "mm"]),
    ["E1 one step before the hit", reply.step_before.point?.slice(1), "mm"],
    ["at alpha", reply.step_before.alpha, unit],
  ]);
  note(hosts.facts, `Assumed and not published: ${reply.assumed.join(", ") || "nothing"}.`);
  const of = (name, k) => reply[name].point.map((p, n) => (p && reply[name].on_rope[n] ? p[k] : null));
  const shown = (name, one, two, title) => ({
    title,
    unit: "mm",
    series: [
      { values: of(name, one), colour: "crank" },
      { values: of(name, two), colour: "body" },
    ],
  });
  const has = (name) => reply[name].on_rope.some(Boolean);
  follow.push(
    seldom(
      curves(hosts.curves, {
        x: reply.alpha,
        xUnit: unit,
        list: [
          ...(has("E1") ? [shown("E1", 1, 2, "E1 along j4 (first) and k4 over alpha")] : []),
          ...(has("E2") ? [shown("E2", 0, 2, "E2 along i5 (first) and k5 over alpha")] : []),
          { title: "Turn of the disc, beta", unit, values: reply.beta, colour: "path" },
          { title: "Turn of the jaw, alpha4", unit, values: reply.alpha4, colour: "pose" },
        ],
      }),
    ),
  );
  run.go(reply.wrap.angle ?? run.value);
  return run;
}

/** A table of verdicts over the first two axes; of more than `MOST_CELLS` cells a list. */
function verdicts(host, reply) {
  const [first, second] = reply.axes;
  const value = (one, axis) => one[axis] ?? one.parameters?.[axis];
  const rows = [...new Set(reply.pairs.map((one) => value(one, first)))],
    columns = [...new Set(reply.pairs.map((one) => value(one, second)))];
  if (rows.length * columns.length > MOST_CELLS) {
    table(
      host,
      "Margins, positive if the condition holds",
      [...reply.axes, "ties", ...CONDITIONS],
      reply.pairs.map((one) => [
        ...reply.axes.map((axis) => value(one, axis)),
        one.feasible,
        ...CONDITIONS.map((name) => one[name]?.margin),
      ]),
    );
    return;
  }
  const cells = document.createElement("table");
  cells.className = "verdicts";
  const caption = cells.createCaption();
  caption.className = "note";
  caption.textContent = `Rows vary ${first}, columns ${second}. Where further parameters vary, the combination with the largest margin is shown. The numbers are margins; positive if the condition holds.`;
  const head = cells.createTHead().insertRow();
  head.append(build("th", { scope: "col", textContent: `${first} \\ ${second}` }));
  for (const column of columns) head.append(build("th", { scope: "col", textContent: text(column, 5) }));
  const body = cells.createTBody();
  for (const row of rows) {
    const made = body.insertRow();
    made.append(build("th", { scope: "row", textContent: text(row, 5) }));
    for (const column of columns) {
      const best = reply.pairs
        .filter((one) => value(one, first) === row && value(one, second) === column)
        .reduce((a, b) => (b.margin > a.margin ? b : a));
      const cell = made.insertCell();
      cell.className = best.feasible ? "yes" : "no";
      cell.append(build("strong", { textContent: best.feasible ? "ties" : "fails" }));
      for (const name of CONDITIONS) {
        if (!best[name]) continue;
        cell.append(
          `${best[name].holds ? "✓" : "✗"} ${name} ${text(best[name].margin, 3)}`,
          document.createElement("br"),
        );
      }
    }
  }
  const scroll = build("div", { className: "scroll", tabIndex: 0 });
  scroll.setAttribute("role", "region");
  scroll.setAttribute("aria-label", "Verdicts");
  scroll.append(cells);
  host.append(scroll);
}

function scan({ reply }, { facts: figures, tables }) {
  verdicts(tables, reply);
  facts(figures, [
    ["status", reply.status],
    ["pairs that tie the knot", `${reply.feasible.length} of ${reply.pairs.length}`],
  ]);
  note(figures, `Assumed and not published: ${reply.assumed.join(", ") || "nothing"}.`);
}

function limit({ reply, request }, { facts: figures, tables }) {
  const condition = request.condition ?? "wrap";
  facts(figures, [
    ["status", reply.status],
    ["condition", condition],
    ["parameter", reply.parameter],
  ]);
  if (!reply.limits.length)
    note(
      figures,
      `The ${condition} ${reply.status === "always" ? "holds" : "fails"} over the whole range of ${reply.parameter}.`,
    );
  if (reply.limits.length)
    table(
      tables,
      "Where the verdict changes",
      [reply.parameter, "holds", "bill angle there", "margin there"],
      reply.limits.map((row) => {
        const part = row.wrap ?? row.clearance ?? row.bite;
        return [row.value, row.holds, part.angle ?? part.worst_angle ?? null, part.margin];
      }),
    );
}

function needle({ reply, request }, { facts: figures }) {
  const unit = degree(request.angle_unit);
  facts(figures, [
    ["status", reply.status],
    ["L, needle to the jaw's cam", reply.clearance, "mm"],
    ["alpha2 with L above 0", reply.alpha2_range, unit],
    ["smallest whole degree", reply.alpha2_whole_degrees, "°"],
    ["largest L", reply.clearance_max, "mm"],
    ["at alpha2", reply.clearance_max_angle, unit],
    ["d5 that eq 5 wants", reply.d5, "mm"],
    ["alpha2 for the d5 asked for", reply.alpha2_for_d5, unit],
  ]);
}

function fit({ reply }, { facts: figures, tables }) {
  facts(figures, [
    ["status", reply.status],
    ["verdicts as wanted", `${reply.entries.filter((one) => one.margin > 0).length} of ${reply.entries.length}`],
    ["smallest margin", reply.margin, "mm"],
    ["directions free to first order", reply.free],
    ["draws that fit as they are", `${reply.reproducing_draws} of ${reply.draws}`],
  ]);
  note(
    figures,
    "A pattern of verdicts bounds the unknowns and does not fix them: each may move alone over the range that is shown.",
  );
  table(
    tables,
    "Unknowns",
    ["unknown", "value", "kept from", "to", ...reply.other_sets.map((_, k) => `set ${k + 2}`)],
    Object.entries(reply.values).map(([name, value]) => [
      name,
      value,
      ...(reply.individual_ranges?.[name] ?? [null, null]),
      ...reply.other_sets.map((one) => one.values[name]),
    ]),
  );
  if (reply.directions)
    table(
      tables,
      "Directions, those that change the margins least first",
      ["", "strength", "kept back", "kept forth", ...Object.keys(reply.values)],
      reply.directions.map((way, k) => [k + 1, way.strength, way.backward, way.forward, ...Object.values(way.vector)]),
    );
  table(
    tables,
    "The pattern",
    ["condition", "alpha1", "alpha3", "wanted", "margin"],
    reply.entries.map((one) => [one.condition, one.alpha1, one.alpha3, one.prescribed, one.margin]),
  );
}

function tolerance({ reply }, { facts: figures, tables }) {
  facts(figures, [
    ["status", reply.status],
    ["samples that tie the knot", 100 * reply.share, "%"],
    ["dimensions with a tolerance", reply.dimensions],
  ]);
  table(
    tables,
    "Conditions within the tolerances",
    ["condition", "margin", "at the worse corner", "least sample", "samples that hold, %", "tolerances until it fails"],
    CONDITIONS.map((name) => {
      const one = reply[name];
      return [name, one.margin, one.corner, one.least, 100 * one.share, one.factor];
    }),
  );
  const names = Object.keys(reply.wrap.sensitivity);
  table(
    tables,
    "Change of the margins per unit of each dimension",
    ["dimension", ...CONDITIONS],
    names.map((name) => [name, ...CONDITIONS.map((one) => reply[one].sensitivity[name])]),
  );
}

const SHOWN = { curves: pair, scan, limit, needle, fit, tolerance };

const still = ({ point, path, corners, on_rope, inside, ...crossing }) => crossing;

export const knotter = {
  numbers: ({ paths, E1, E2, ...reply }) => (paths ? { ...reply, E1: still(E1), E2: still(E2) } : reply),
  show: (answer, hosts) => SHOWN[answer.query.path.split("/").at(-1)](answer, hosts) ?? null,
};
