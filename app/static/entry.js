// A four-bar that the user enters by its joints or its lengths, and the motion of its body.

import { numberIn } from "./decimal.js";
import { element } from "./drawing.js";
import { fromJoints } from "./hand.js";
import { Linkage } from "./kinematics.js";
import { emptyMotion } from "./motion.js";
import { RAD } from "./plane.js";
import { $, build } from "./shell.js";

const JOINTS = [
  ["a", "A, crank pivot"],
  ["d", "D, crank pin"],
  ["c", "C, rocker pin"],
  ["b", "B, rocker pivot"],
  ["p", "P, body point"],
];
const LENGTHS = ["crank", "coupler", "rocker", "ground"];
const STEP = 15; // degrees of crank between the samples of a whole turn
const SAMPLES = 12; // steps between the samples of a crank that swings

const field = (id, hidden, shown, attributes) => {
  const input = build("input", { id, inputMode: "decimal", autocomplete: "off" }),
    label = document.createElement("label");
  Object.assign(input.dataset, { number: "", ...attributes });
  label.append(element("span", "hidden", hidden), shown, input);
  return label;
};

/** The joints of a four-bar of these lengths with A in the origin, and P in the middle of the coupler; null if it cannot be assembled. */
function jointsOf([crank, coupler, rocker, ground]) {
  const linkage = new Linkage({
    links: { crank, coupler, rocker, ground },
    branch: 1,
    start_angle: 0,
    mount: { pivot_a: [0, 0], ground_angle: 0, coupler_point_polar: { radius: coupler / 2, angle: 0 } },
  });
  return linkage.over(60 * RAD, 420 * RAD, 720).find(Boolean) ?? null;
}

/** Degrees by which the crank can turn back and on from the start, one after the other. */
function swing(linkage) {
  const reach = (sense) => {
    let angle = 0;
    while (angle < 360 && linkage.at(sense * (angle + 1) * RAD)) angle += 1;
    return angle;
  };
  const [back, on] = [reach(-1), reach(1)],
    spare = back + on > 4 ? 1 : 0; // at its ends a loop is nearly open
  return [-back + spare, on - spare];
}

/** {motion, solution} of a four-bar by its joints: full poses of the body while the crank turns, the angle counted from the position entered. */
export function motionOf(joints, unit) {
  const begun = fromJoints({ ...joints, rotation: 0 }, 0, {
    links: {},
    body_offset: 0,
    crank_angle: null,
    errors: { objective: 0 },
  });
  if (!begun) throw new Error("Two joints coincide there: each link needs a length.");
  const { turnsFully } = new Linkage(begun),
    [low, high] = turnsFully ? [0, 360 - STEP] : swing(new Linkage(begun));
  if (high - low < 1) throw new Error("The crank can hardly turn from there: enter another position.");
  const solution = { ...begun, start_angle: begun.start_angle + low },
    linkage = new Linkage(solution),
    count = turnsFully ? 360 / STEP : SAMPLES + 1,
    span = high - low;
  const poses = Array.from({ length: count }, (_, k) => {
    const t = (span * k) / (count - 1),
      {
        p: [x, y],
        rotation,
      } = linkage.at(t * RAD);
    return Object.fromEntries(
      Object.entries({ t, x, y, angle: rotation / RAD }).map(([name, value]) => [name, Number(value.toPrecision(12))]),
    );
  });
  const motion = emptyMotion();
  Object.assign(motion.limits, { family: "any", kept: { use: false, turn: false, ratio: false, reach: false } });
  return {
    solution,
    motion: Object.assign(motion, {
      poses,
      timing: "table",
      span,
      unit,
      mechanisms: "four_bar",
      note: "Motion of a linkage that was entered.",
    }),
  };
}

/** Binds the dialog; `unit()` is the unit of the lengths on the page, `use(entered)` gets what `motionOf` makes. */
export function startEntry(unit, use) {
  const dialog = $("entry"),
    ids = (name) => ["x", "y"].map((axis) => `entry-${name}-${axis}`);
  for (const [name, title] of JOINTS) {
    const group = document.createElement("fieldset");
    group.append(
      element("legend", "", title),
      ...["x", "y"].map((axis, k) => field(ids(name)[k], `${title}, `, axis, {})),
    );
    $("entry-joints").append(group);
  }
  $("entry-lengths").append(...LENGTHS.map((name) => field(`entry-${name}`, "", name, { least: "above 0" })));
  const attempt = (work) => {
    $("entry-error").textContent = "";
    try {
      work();
    } catch (error) {
      $("entry-error").textContent = error.message;
    }
  };
  const place = () =>
    attempt(() => {
      const lengths = LENGTHS.map((name) => numberIn(`entry-${name}`));
      if (lengths.includes(null)) return;
      const joints = jointsOf(lengths);
      if (!joints)
        throw new Error("Links of these lengths cannot be assembled: the longest is longer than the others together.");
      for (const [name] of JOINTS)
        ids(name).forEach((id, k) => {
          $(id).value = Number(joints[name][k].toPrecision(10));
        });
    });
  $("entry-lengths").addEventListener("change", place);
  $("entry-open").addEventListener("click", () => {
    dialog.showModal();
    $("entry-a-x").focus();
  });
  $("entry-close").addEventListener("click", () => dialog.close());
  $("entry-form").addEventListener("submit", (event) => {
    event.preventDefault();
    attempt(() => {
      const joints = Object.fromEntries(JOINTS.map(([name]) => [name, ids(name).map(numberIn)]));
      if (Object.values(joints).flat().includes(null))
        throw new Error("Both coordinates of each of the five joints are needed, or the four lengths.");
      const entered = motionOf(joints, unit());
      dialog.close();
      use(entered);
    });
  });
}
