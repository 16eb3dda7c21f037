// Vectors of the plane, [x, y]; angles in radians, counter-clockwise.

/** Radians in a degree. */
export const RAD = Math.PI / 180;

export const add = ([a, b], [c, d]) => [a + c, b + d];
export const less = ([a, b], [c, d]) => [a - c, b - d];
export const times = ([a, b], factor) => [a * factor, b * factor];
export const turned = ([x, y], angle) => [
  x * Math.cos(angle) - y * Math.sin(angle),
  x * Math.sin(angle) + y * Math.cos(angle),
];
/** The unit vector of an angle. */
export const along = (angle) => [Math.cos(angle), Math.sin(angle)];
export const cross = ([a, b], [c, d]) => a * d - b * c;
export const dot = ([a, b], [c, d]) => a * c + b * d;
export const size = ([x, y]) => Math.hypot(x, y);
export const direction = ([x, y]) => Math.atan2(y, x);
/** Numbers, points or objects of these, at a share of the way from one to another. */
export function between(from, to, share) {
  if (typeof from === "number") return from + share * (to - from);
  if (Array.isArray(from)) return from.map((part, k) => between(part, to[k], share));
  return Object.fromEntries(Object.entries(from).map(([name, part]) => [name, between(part, to[name], share)]));
}
