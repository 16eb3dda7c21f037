// The drives and springs that are offered: the best of a reply, their names, and the numbers by which they are compared.

import { text } from "./drawing.js";
import { settled } from "./fit.js";

export const KINDS = { actuator: "cylinder", rotary: "drive in a hinge", dyad: "motor and rod", toggle: "lock" };
export const BEST = 3; // drives that are offered

/** The name of a link in words. */
export const plain = (link) => link.replaceAll("_", " ");

/** A number with its thousands apart. */
export const grouped = (number) => number.replace(/^-?\d+/, (whole) => whole.replace(/\B(?=(\d{3})+$)/g, "\u202f"));

/** What a card calls a drive or a set of springs. */
export function nameOf(drive) {
  if (drive.springs)
    return drive.springs
      .map(({ count, kind, name }) => `${count > 1 ? `${count} × ` : ""}${name ?? `ideal ${kind} spring`}`)
      .join(" and ");
  const sizes = drive.retracted ? ` ${text(drive.retracted, 4)} + ${text(drive.stroke, 4)}` : "";
  return `${drive.name ?? `${KINDS[drive.kind]}${sizes}`} on the ${plain(drive.link)}`;
}

/** The best drives of a reply, at most one of each kind if there are several, or its springs, a set each: that which leaves least torque first. */
export function optionsOf({ drives, springs }) {
  const kinds = [...new Set(drives.map(({ kind }) => kind))],
    sets = [...new Set(springs.map(({ set }) => set))];
  const best = kinds.length > 1 ? kinds.map((kind) => drives.find((one) => one.kind === kind)) : drives.slice(0, BEST);
  const left = ({ springs: [one] }) => one.torque.after.rms;
  return [
    ...best,
    ...sets
      .map((set) => ({ springs: springs.filter((one) => one.set === set) }))
      .sort((a, b) => left(a) - left(b))
      .slice(0, BEST),
  ];
}

/** Rows [name, words] by which drives are compared: force, stroke, price and place. */
export function factsOf(drive, unit, newtons) {
  const rows = [],
    amount = (one, more = "") => `${grouped(text(one, 4))}${newtons ? ` N${more}` : ""}`,
    torque = (one) => amount(one, `·${unit}`);
  const point = (pair) => `${pair.map((one) => text(one, 4)).join(", ")} ${unit}`;
  if (drive.springs) {
    const [first] = drive.springs,
      { before, after } = first.torque;
    return [
      ["torque left", `${torque(settled(after.rms, before.rms))} of ${torque(before.rms)}`],
      ["where", drive.springs.map((one) => one.between.join(" to ")).join(", ")],
      ["by itself", first.motion_at_ends],
    ];
  }
  if (Number.isFinite(drive.peak_torque)) rows.push(["torque", torque(drive.peak_torque)]);
  else if (Number.isFinite(drive.peak_force)) rows.push(["force", amount(drive.peak_force)]);
  if (drive.stroke) rows.push(["stroke", `${text(drive.stroke, 4)} ${unit}`]);
  else if (Number.isFinite(drive.swing)) rows.push(["swing", `${text(drive.swing, 4)}°`]);
  if (Number.isFinite(drive.price)) rows.push(["price", text(drive.price, 3)]);
  const at = drive.motor ?? drive.ground_point;
  if (at) rows.push(["where", drive.on && drive.on !== "ground" ? `on the ${plain(drive.on)}` : point(at)]);
  return rows;
}
