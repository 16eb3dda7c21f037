// The lift's page: cylinder, triangle and platform in motion, its curves, and the optimum beside the published design.

import { curves, facts, note, table } from "./answer.js";
import { text } from "./drawing.js";
import { dot, line, stage, symbol } from "./stage.js";

const LENGTHS = ["l2", "l3", "l4", "l5", "b"];
const SMOOTH = 201; // times of a drawing's motion: curves through fewer have kinks

const between = ([x, y], [u, v], share = 0.5) => [x + share * (u - x), y + share * (v - y)];

/** The poses at the times of a motion with points, and between them, where time runs evenly. */
function poses({ time, points }) {
  const at = (list, k, share) => between(list[k], list[k + 1] ?? list[k], share);
  return (now) => {
    let k = Math.min(
      Math.max(0, Math.floor(((now - time[0]) / (time.at(-1) - time[0])) * (time.length - 1))),
      Math.max(0, time.length - 2),
    );
    while (k > 0 && time[k] > now) k--;
    while (k < time.length - 2 && time[k + 1] < now) k++;
    // a slider stops beside its end by rounding
    const share = time.length > 1 ? Math.round((1e9 * (now - time[k])) / (time[k + 1] - time[k])) / 1e9 : 0;
    return {
      k,
      share,
      O: [0, 0],
      D: points.D,
      A: at(points.A, k, share),
      B: at(points.B, k, share),
      C: at(points.C, k, share),
    };
  };
}

/** The mechanism in motion: cylinder O-B, triangle A B C, link D-C, platform at A on its slide. */
function drawing(host, moved, follow) {
  const { points, time, height, velocity } = moved,
    pose = poses(moved),
    wide = 0.26 * Math.max(...height);
  const [low, high] = [points.D, [points.D[0], 1.06 * Math.max(...height)]];
  const value = (list, { k, share }) => list[k] + share * ((list[k + 1] ?? list[k]) - list[k]);
  return stage(host, {
    label: `The lift from height ${text(height[0], 5)} to ${text(height.at(-1), 5)} millimetres`,
    extent: [[0, 0], points.D, high, ...points.A, ...points.B, ...points.C, [points.D[0] - wide, 0]],
    play: { name: "Time", from: time[0], to: time.at(-1), seconds: time.at(-1) - time[0] },
    words: (now) => {
      const at = pose(now);
      return `${text(now, 4)} s, height ${text(value(height, at), 5)} mm, ${text(value(velocity, at), 4)} mm/s`;
    },
    follow,
    draw(layer, view) {
      line(
        layer,
        "axis",
        [
          [view.world(0, 0)[0], 0],
          [view.world(view.width, 0)[0], 0],
        ],
        view,
      );
      line(layer, "ground", [low, high], view);
      line(layer, "curve turn", points.B, view);
      line(layer, "curve turn", points.C, view);
      const body = line(layer, "body"),
        tube = line(layer, "link crank tube"),
        rod = line(layer, "link crank"),
        link = line(layer, "link rocker"),
        platform = line(layer, "link platform");
      const pins = Object.fromEntries(
        ["O", "D", "A", "B", "C"].map((name) => [name, dot(layer, name === "O" || name === "D" ? "fixed" : "pin", 6)]),
      );
      const names = Object.fromEntries(
        ["O", "D", "A", "B", "C", "l1", "l2", "l3", "l4", "l5", "b", "s"].map((name) => [name, symbol(layer, name)]),
      );
      const shut = Math.min(...moved.cylinder_length) * 0.92;
      return (now) => {
        const at = pose(now),
          { O, A, B, C, D } = at;
        body([A, B, C, A], view);
        tube([O, between(O, B, Math.min(1, shut / Math.hypot(...B)))], view);
        rod([O, B], view);
        link([D, C], view);
        platform(
          [
            [A[0] - wide, A[1]],
            [A[0] + wide, A[1]],
          ],
          view,
        );
        const name = (word, place, ...off) => names[word](place, view, ...off);
        for (const [word, place] of Object.entries({ O, D, A, B, C })) {
          pins[word](place, view);
          name(word, place);
        }
        for (const [word, place] of [
          ["l1", between(O, B)],
          ["l2", between(A, B)],
          ["l3", between(A, C)],
          ["l4", between(B, C)],
          ["l5", between(D, C, 0.2)],
        ])
          name(word, place, 6, -5);
        name("b", between(O, D), 6, 16);
        name("s", between(D, A), -16, -5);
      };
    },
  });
}

const CURVES = [
  ["Height of the platform", "mm", "height"],
  ["Speed of the platform", "mm/s", "velocity"],
  ["Acceleration of the platform", "mm/s²", "acceleration"],
  ["Length of the cylinder", "mm", "cylinder_length"],
];

/** The forces of a reply as curves; what is available is dashed. */
function forceCurves({ forces, time }, { pressure }) {
  const level = { values: time.map(() => pressure), colour: "box", dash: [6, 4], width: 1.2 };
  return [
    {
      title: "Forces of cylinder (blue), link (green), slide (red)",
      unit: "N",
      series: ["cylinder", "link", "slide"].map((name, k) => ({
        values: forces[name],
        colour: ["body", "path", "pose"][k],
      })),
    },
    {
      title: "Pressure needed (dashed: available)",
      unit: "bar",
      series: [{ values: forces.pressure, colour: "body" }, level],
    },
  ];
}

/** A motion: drawing and curves that follow one another. */
function motion(moved, { picture, curves: charts }, pneumatics = null) {
  const list = [
    ...CURVES.map(([title, unit, name]) => ({ title, unit, values: moved[name] })),
    ...(moved.forces ? forceCurves(moved, { pressure: 6, ...pneumatics }) : []),
  ];
  return drawing(picture, moved, curves(charts, { x: moved.time, xUnit: "s", list }));
}

/** A question for a motion as its drawing needs it: even times, of the whole motion, and points. */
const smooth = ({ times, ...request }) => ({
  ...request,
  samples: Math.max(SMOOTH, request.samples ?? 0),
  include: [...new Set([...(request.include ?? []), "points"])],
});

function motionFacts(host, reply) {
  facts(host, [
    ["time of the rise", reply.rise_time, "s"],
    ["height at the start", reply.height_start, "mm"],
    ["height at the end", reply.height_end, "mm"],
    ["cylinder at the top", reply.length_top, "mm"],
    ["cylinder at the dead point", reply.dead_point_length, "mm"],
    ["condition number, smallest", reply.condition.min],
    ["condition number at the start", reply.condition.start],
  ]);
  if (!reply.forces) return;
  const { forces } = reply;
  facts(
    host,
    [
      ["largest force of the cylinder", forces.cylinder_max, "N"],
      ["least force of the cylinder", forces.cylinder_min, "N"],
      ["largest pressure needed", forces.pressure_max, "bar"],
      ["pressure is enough", forces.pressure_is_enough],
      ["least bore", forces.bore_min, "mm"],
    ],
    "Forces",
  );
  if (reply.residual !== null) facts(host, [["largest loop residual", reply.residual, "mm"]]);
}

const UNITS = {
  extension: "",
  dead_point: "",
  acceleration: "mm/s²",
  jerk: "mm/s³",
  rise_time: "s",
  transmission_angle: "°",
  force_ratio: "",
};

/** Limits that hold a design, in words: `jerk<=max` is "jerk at most". */
const held = (names) =>
  names?.map((name) => name.replace("<=max", " at most").replace(">=min", " at least").replaceAll("_", " "));

/** What an optimum has beside each limit, those that hold it first. */
function limits(host, reply, unit) {
  const rows = reply.constraints.toSorted((one, two) => two.active - one.active);
  const of = (name) => UNITS[name] ?? "mm";
  table(
    host,
    "Constraints",
    ["limit of", "has", "", "limit", "unit", "holds the design"],
    rows.map((row) => [
      row.name.replaceAll("_", " "),
      row.value,
      row.kind === "least" ? "≥" : "≤",
      row.limit,
      of(row.name).replace("°", unit === "rad" ? "rad" : "°"),
      row.active,
    ]),
  );
  const { unconstrained: free } = reply;
  if (!free) return;
  const broken = free.violated
    .map((row) => `${row.name.replaceAll("_", " ")} ${text(row.value, 3)}${of(row.name) ? ` ${of(row.name)}` : ""}`)
    .join(", ");
  note(
    host,
    `The source's problem, for the same objective, has the optimum ${text(free.objective, 5)}: this one is ${text(Math.abs(100 * reply.cost), 3)} % ${reply.cost < 0 ? "below" : "above"}. ${broken ? `Outside of the limits there: ${broken}.` : "It keeps to all limits."}`,
  );
}

export const lift = {
  request: (query, request) => (query.path === "/v2/lift/motion" && !request.times ? smooth(request) : request),

  async show({ query, request, reply, ask }, hosts) {
    if (query.path === "/v2/lift/motion") {
      motionFacts(hosts.facts, reply);
      return motion(request.times ? await ask(query.path, smooth(request)) : reply, hosts, request.pneumatics);
    }
    if (query.path === "/v2/lift/batch") {
      table(
        hosts.tables,
        "An optimum for each cylinder",
        [
          { name: "l1′", unit: "mm" },
          { name: "speed", unit: "mm/s" },
          ...LENGTHS.map((name) => ({ name, unit: "mm" })),
          "f",
          "f published",
          { name: "rise time", unit: "s" },
          "held by",
        ],
        reply.rows.map((row) => [
          row.cylinder.length,
          row.cylinder.speed,
          ...LENGTHS.map((name) => row.design?.[name]),
          row.objective,
          row.objective_of_published,
          row.motion?.rise_time,
          held(row.active) ?? row.detail,
        ]),
      );
      return null;
    }
    const beside = reply.published
      ? [[`published (${reply.published.source})`, reply.published]]
      : reply.unconstrained
        ? [["the source's problem", reply.unconstrained]]
        : [];
    const columns = [["optimum", reply], ...beside];
    table(
      hosts.facts,
      "Design",
      ["", ...columns.map(([name]) => name)],
      [
        ...LENGTHS.map((name) => [`${name}, mm`, ...columns.map(([, one]) => one.design[name])]),
        ["closed l1′, mm", reply.closed_length, ...beside.map(() => request.cylinder.length)],
        ["objective", ...columns.map(([, one]) => one.objective)],
      ],
    );
    facts(hosts.facts, [
      ["time of the rise", reply.motion.rise_time, "s"],
      ["speed at the start", reply.motion.velocity_start, "mm/s"],
      ["mean speed over height", reply.motion.velocity_mean, "mm/s"],
      ["cylinder at the dead point", reply.motion.dead_point_length, "mm"],
      ["held by", held(reply.active)],
      ["evaluations", reply.evaluations],
    ]);
    if (reply.published) note(hosts.facts, `Published design: ${reply.published.reason}.`);
    note(hosts.facts, reply.note);
    if (reply.constraints) limits(hosts.tables, reply, request.angle_unit);
    return motion(
      await ask(
        "/v2/lift/motion",
        smooth({ design: reply.design, cylinder: { ...request.cylinder, length: reply.closed_length } }),
      ),
      hosts,
    );
  },
};
