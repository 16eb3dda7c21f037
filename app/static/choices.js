// The drives and springs that are offered: the best of a reply, their names, and their numbers in words.

import { text } from "./drawing.js";
import { settled } from "./fit.js";
import { spaced } from "./shell.js";

export const KINDS = { actuator: "cylinder", rotary: "drive in a hinge", dyad: "motor and rod" };
export const BEST = 3; // drives that are offered

/** A number with its thousands apart. */
const grouped = (number) => number.replace(/^-?\d+/, (digits) => digits.replace(/\B(?=(\d{3})+$)/g, "\u202f"));

const times = ({ count }) => (count > 1 ? `${count} × ` : "");

/** The name of a drive or a set of springs on its card. */
export function nameOf(drive) {
  if (drive.springs)
    return drive.springs.map((spring) => times(spring) + (spring.name ?? `ideal ${spring.kind} spring`)).join(" and ");
  const sizes = drive.retracted ? ` ${text(drive.retracted, 4)} + ${text(drive.stroke, 4)}` : "";
  return `${drive.name ?? `${KINDS[drive.kind]}${sizes}`} on the ${spaced(drive.link)}`;
}

/** The best drives of a reply, one of each kind if there are several, and its sets of springs by the torque left. */
export function optionsOf({ drives, springs }) {
  const kinds = [...new Set(drives.map(({ kind }) => kind))];
  const best =
    kinds.length > 1 ? kinds.map((kind) => drives.find((drive) => drive.kind === kind)) : drives.slice(0, BEST);
  const sets = [...new Set(springs.map(({ set }) => set))].map((set) => springs.filter((spring) => spring.set === set)),
    left = ([spring]) => spring.torque.after.rms;
  sets.sort((a, b) => left(a) - left(b));
  return [...best, ...sets.slice(0, BEST).map((set) => ({ springs: set }))];
}

/** The unit of a moment arm: a change of length by the angle, or by the travel, of what drives the linkage. */
export const armUnit = (unit, turns) => (turns ? `${unit} a radian` : `${unit} a ${unit} of travel`);

/** Return the formatters of numbers with their units. */
function wordsOf({ unit }) {
  const force = (value) => `${grouped(text(value, 4))} N`,
    torque = (value) => `${force(value)}·${unit}`;
  const point = (pair, digits = 5) => `${pair.map((value) => text(value, digits)).join(", ")} ${unit}`,
    left = ({ before, after }) => `${torque(settled(after.rms, before.rms))} of ${torque(before.rms)}`;
  return { force, torque, point, left, length: (value) => `${text(value, 4)} ${unit}` };
}

/** Rows [name, words] by which drives are compared: force, stroke, price and place. */
export function factsOf(drive, how) {
  const { force, torque, point, left, length } = wordsOf(how);
  if (drive.springs) {
    const [first] = drive.springs,
      ends = drive.springs.map(({ between }) => between.join(" to ")).join(", ");
    return Object.entries({ "torque left": left(first.torque), where: ends, "by itself": first.motion_at_ends });
  }
  const at = drive.motor ?? drive.ground_point,
    { peak_torque: moment, peak_force: push, swing, stroke, price, base_link } = drive;
  const rows = [
    Number.isFinite(moment) ? ["torque", torque(moment)] : Number.isFinite(push) && ["force", force(push)],
    stroke ? ["stroke", length(stroke)] : Number.isFinite(swing) && ["swing", `${text(swing, 4)}°`],
    Number.isFinite(price) && ["price", text(price, 3)],
    at && ["where", base_link && base_link !== "ground" ? `on the ${spaced(base_link)}` : point(at, 4)],
  ];
  return rows.filter(Boolean);
}

function springRows(spring, { unit, ...how }) {
  const { force, point, left } = wordsOf({ unit, ...how }),
    angle = (value) => text(value, 4),
    { kind, name, stiffness, between, twist, curve, length } = spring;
  const geometry =
    kind === "torsion"
      ? {
          "its joint": point(spring.point),
          "its twist": `${twist.map(angle).join(" to ")}°, ${angle(curve.twist[0])}° at the first pose`,
        }
      : {
          "its ends": spring.points.map((end) => point(end)).join(" and "),
          "its length": `${length.map((value) => text(value, 5)).join(" to ")} ${unit}`,
        };
  return [
    [`${times(spring)}${kind} spring`, `${name ?? `${force(stiffness)} per ${unit}`}, ${between.join(" to ")}`],
    ...Object.entries(geometry),
    ["torque left (rms)", left(spring.torque)],
    ["by itself", spring.motion_at_ends],
  ];
}

/** Rows [name, value] of a drive or its springs; `how` is {unit, turns, item}, `turns` of the linkage. */
export function rowsOf(drive, how) {
  if (drive.springs) return drive.springs.flatMap((spring) => springRows(spring, how));
  const { unit, turns, item } = how,
    { force, torque, point } = wordsOf(how),
    number = (value, digits = 5) => text(value, digits),
    { kind, count, retracted, stroke, dead, arm_min: arm, peak_force: push, peak_force_ratio: ratio } = drive,
    { peak_torque: moment, buckling, six_bar: bars } = drive;
  const side = count > 1 ? `, ${count} side by side` : "",
    moves = drive.extends ? "extends" : "retracts",
    bound = ratio ? `, ${number(ratio, 4)} × the smallest possible` : "",
    safe = buckling?.safety === null ? "never pushed" : `${number(buckling?.safety, 3)} times safe`;
  const rows = [
    ["drive", `${drive.name ?? KINDS[kind]} on the ${spaced(drive.link)}${side}${drive.byHand ? ", by hand" : ""}`],
    drive.motor && ["motor", point(drive.motor)],
    drive.ground_point && ["ground point", point(drive.ground_point)],
    drive.pin && [`pin at ${item} 1`, point(drive.pin)],
    drive.pin && ["pin on the link", point(drive.pin_on_link)],
    retracted && ["retracted, stroke", `${number(retracted)} + ${number(stroke)} ${unit}, ${moves}`],
    Number.isFinite(dead) && ["dead point", `at ${number(dead)}${turns ? "°" : ` ${unit}`}`],
    Number.isFinite(arm) && ["smallest moment arm", `${number(arm)} ${armUnit(unit, turns)}`],
    Number.isFinite(push) && ["peak force", force(push) + bound],
    Number.isFinite(moment) && ["peak torque", torque(moment)],
    drive.holding && ["holding, first and last", drive.holding.map(kind === "rotary" ? torque : force).join(", ")],
    buckling && ["buckling", safe],
    bars && ["crank and rod", `${number(bars.crank)}, ${number(bars.coupler)} ${unit}`],
    bars && ["time ratio", number(bars.time_ratio, 4)],
    bars && ["transmission of the rod", `${number(bars.transmission_angle_min, 4)}° or more`],
    ["stops", drive.stops],
    ["without power", drive.holds],
  ];
  return rows.filter(Boolean);
}
