// The question of the step Build: its fields as a request for drives or springs, without the linkage.

import { numberIn, numbersIn } from "./decimal.js";
import { $ } from "./shell.js";

const SPRINGS = ["tension", "gas", "compression", "torsion"];
/** Drives that "best of all drives" asks for; others are asked for by their own kind. */
const DRIVES = ["rotary", "actuator", "dyad"];

const value = (id) => numberIn(`drive-${id}`);
const chosen = (id) => $(`drive-${id}`).value;
const checked = (id) => $(`drive-${id}`).checked;

const filledIn = (fields) =>
  Object.fromEntries(Object.entries(fields).filter(([, content]) => content !== null && content !== ""));

/** Return numbers that belong together, null if all are blank. Throws an error if only some are blank. */
function together(ids, sentence) {
  const numbers = ids.map(value);
  if (numbers.every((number) => number === null)) return null;
  if (numbers.includes(null)) throw new Error(sentence);
  return numbers;
}

function loadOf() {
  const force = [value("force-x") ?? 0, value("force-y") ?? 0],
    acts = force.some(Boolean),
    mass = value("mass"),
    link = chosen("on");
  return filledIn({
    force: acts && link === "body" ? force : null,
    forces: acts && link !== "body" ? [{ link, force }] : null,
    torque: value("torque"),
    masses: mass ? [{ link, mass }] : null,
    parts: checked("parts") || null,
  });
}

function springsOf(kind, ground_box) {
  if (kind === "ideal") return [{ kind: "tension" }];
  const [open, closed] = ["holds-open", "holds-closed"].map(checked),
    curve = numbersIn("drive-wanted", 2, true);
  const behaviour = {
    holds: open || closed ? { open, closed, ...filledIn({ force_min: value("hold-force") }) } : null,
    hand_force_max: value("hand-force"),
    target: curve && { [chosen("wanted-of")]: curve },
    count: value("count"),
  };
  const spring = (name) =>
    filledIn({
      kind: name,
      catalogue: name === "tension" ? "tension_springs" : null,
      ...behaviour,
      ground_box: name === "torsion" ? null : ground_box,
    });
  return SPRINGS.filter((name) => [name, "springs"].includes(kind)).map(spring);
}

/** The drives asked for; `table` is the user's own catalogue. */
function drivesOf(kind, box, table) {
  const catalogue = chosen("catalogue"),
    reach_max = value("reach");
  const sizes =
    catalogue === ""
      ? { retracted: value("retracted"), stroke: value("stroke") }
      : { catalogue: catalogue === "own" ? (table ?? "") : catalogue };
  const sentence = "Ends: give x and y of the ground point and of the pin, or none of them.",
    isCylinder = kind === "actuator",
    ends = isCylinder ? together(["ground-x", "ground-y", "pin-x", "pin-y"], sentence) : null,
    searched = { ground_box: box, pin_box: isCylinder ? numbersIn("drive-pin-box", 4) : null },
    fixed = ends && { links: [chosen("link")], ground_point: ends.slice(0, 2), pin: ends.slice(2) };
  const wishes = {
    rotary: {},
    actuator: { ...sizes, reach_max, count: isCylinder ? value("count") : null, ...(fixed ?? searched) },
    dyad: { time_ratio: value("ratio"), reach_max, motor_box: box },
  };
  return (kind === "any" ? DRIVES : [kind]).map((name) => ({ kind: name, ...filledIn(wishes[name]) }));
}

/** {load, drives, springs} that the fields ask for. Throws Error with a sentence if they cannot be used. */
export function readQuestion(table) {
  const kind = chosen("kind"),
    sides = [0, 1, 2, 3].map((k) => `box-${k}`),
    box = together(sides, "Where may it be mounted? Give all four sides of the box, or none of them."),
    load = loadOf();
  if ([...SPRINGS, "springs", "ideal"].includes(kind)) return { load, drives: [], springs: springsOf(kind, box) };
  return { load, drives: drivesOf(kind, box, table) };
}

/** Shows the fields that the chosen kind and catalogue have. */
export function showQuestion() {
  const kind = chosen("kind");
  for (const part of document.querySelectorAll("#drive-card [data-kinds]"))
    part.hidden = !part.dataset.kinds.split(" ").includes(kind);
  for (const part of document.querySelectorAll("#drive-card [data-sizes]")) part.hidden ||= chosen("catalogue") !== "";
}
