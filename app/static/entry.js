// A four-bar that the user enters by its joints or its lengths, and the motion of its body.

import { numberIn } from "./decimal.js";
import { LINKS } from "./fit.js";
import { fromJoints } from "./hand.js";
import { Linkage } from "./kinematics.js";
import { emptyMotion } from "./motion.js";
import { RAD } from "./plane.js";
import { $, listen } from "./shell.js";

const JOINTS = ["a", "d", "c", "b", "p"];
const NOTE = "Motion of a linkage that was entered.";
const OPEN = "Links of these lengths cannot be assembled: the longest is longer than the others together.";
const STEP = 15; // degrees of crank between the samples of a whole turn
const SAMPLES = 12; // steps between the samples of a crank that swings

/** The joints of a four-bar of these lengths, A in the origin, P in the middle of the coupler; null if it is open. */
function jointsOf([crank, coupler, rocker, ground]) {
  const links = { crank, coupler, rocker, ground },
    mount = { pivot_a: [0, 0], ground_angle: 0, coupler_point_polar: { radius: coupler / 2, angle: 0 } },
    linkage = new Linkage({ links, branch: 1, start_angle: 0, mount });
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

/** {motion, solution} of a four-bar by its joints: poses of the body while the crank turns. */
function motionOf(joints, unit) {
  const blank = { links: {}, body_offset: 0, crank_angle: null, errors: { objective: 0 } },
    begun = fromJoints({ ...joints, rotation: 0 }, 0, blank);
  if (!begun) throw new Error("Two joints coincide there: each link needs a length.");
  const { turnsFully } = new Linkage(begun),
    [low, high] = turnsFully ? [0, 360 - STEP] : swing(new Linkage(begun));
  if (high - low < 1) throw new Error("The crank can turn by less than a degree from there. Enter another position.");
  const solution = { ...begun, start_angle: begun.start_angle + low },
    linkage = new Linkage(solution),
    count = turnsFully ? 360 / STEP : SAMPLES + 1,
    span = high - low;
  const poses = Array.from({ length: count }, (_, k) => {
    const t = (span * k) / (count - 1),
      { p, rotation } = linkage.at(t * RAD),
      [x, y, angle] = [...p, rotation / RAD].map((value) => Number(value.toPrecision(12)));
    return { t: Number(t.toPrecision(12)), x, y, angle };
  });
  const motion = emptyMotion();
  Object.assign(motion.limits, { family: "any", kept: { use: false, turn: false, ratio: false, reach: false } });
  Object.assign(motion, { poses, timing: "table", span, unit, mechanisms: "four_bar", note: NOTE });
  return { solution, motion };
}

/** Binds the dialog; `unit()` is the unit of the lengths on the page, `use(entered)` gets what `motionOf` makes. */
export function startEntry(unit, use) {
  const dialog = $("entry"),
    ids = (name) => ["x", "y"].map((axis) => `entry-${name}-${axis}`);
  const attempt = (work) => {
    $("entry-error").textContent = "";
    try {
      work();
    } catch (error) {
      $("entry-error").textContent = error.message;
    }
  };
  const placeLinkage = () =>
    attempt(() => {
      const lengths = LINKS.map((name) => numberIn(`entry-${name}`));
      if (lengths.includes(null)) return;
      const joints = jointsOf(lengths);
      if (!joints) throw new Error(OPEN);
      for (const name of JOINTS)
        for (const [k, id] of ids(name).entries()) $(id).value = Number(joints[name][k].toPrecision(10));
    });
  listen("entry-lengths", "change", placeLinkage);
  listen("entry-open", "click", () => {
    dialog.showModal();
    $("entry-a-x").focus();
  });
  listen("entry-close", "click", () => dialog.close());
  listen("entry-form", "submit", (event) => {
    event.preventDefault();
    attempt(() => {
      const joints = Object.fromEntries(JOINTS.map((name) => [name, ids(name).map(numberIn)]));
      if (Object.values(joints).flat().includes(null))
        throw new Error("Both coordinates of each of the five joints are needed, or the four lengths.");
      const entered = motionOf(joints, unit());
      dialog.close();
      use(entered);
    });
  });
}
