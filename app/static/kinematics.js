// Kinematics of the planar four-bar: the closed form of synthesis/fourbar/kinematics.py, for drawing in the browser.
// Lengths L1 crank, L2 coupler, L3 rocker, L4 ground; radians, counter-clockwise from the ground line A->B.

const TURN = 2 * Math.PI;

function twoSum(a, b) {
  const total = a + b, part = total - a;
  return [total, a - (total - part) + (b - part)];
}

/** (a + b) - (c + d) with the rounding errors of both sums taken into account. */
function pairDifference(a, b, c, d) {
  const [left, leftError] = twoSum(a, b), [right, rightError] = twoSum(c, d);
  return left - right + (leftError - rightError);
}

/** Lengths divided by a power of two near the longest; null unless all are finite and positive. */
function scaled(links) {
  if (!links.every((value) => Number.isFinite(value) && value > 0)) return null;
  const exponent = Math.floor(Math.log2(Math.max(...links))) + 1;
  // in two steps: 2 ** 1074 overflows
  const half = Math.trunc(exponent / 2);
  return links.map((value) => (value * 2 ** -half) * 2 ** -(exponent - half));
}

function grashofExcesses([l1, l2, l3, l4]) {
  return [pairDifference(l2, l4, l1, l3), pairDifference(l3, l4, l1, l2), pairDifference(l2, l3, l1, l4)];
}

export function family(links) {
  const unit = scaled(links);
  if (!unit) return "triple_rocker";
  const [a, b, c] = grashofExcesses(unit);
  if (Math.min(...[a, b, c].map(Math.abs)) <= 1e-12 * Math.max(...unit)) return "change_point";
  if (a > 0 && b > 0 && c > 0) return "crank_rocker";
  if (a < 0 && b < 0 && c > 0) return "double_crank";
  if (a > 0 && b < 0 && c < 0) return "rocker_crank";
  if (a < 0 && b > 0 && c < 0) return "double_rocker";
  return "triple_rocker";
}

const turnsFully = (links) => ["crank_rocker", "double_crank"].includes(family(links));

/** Angles of the loop at a crank angle, {coupler, rocker, transmission}; null where the links do not close. */
export function closeLoop(links, branch, angle) {
  const unit = scaled(links);
  if (!unit || !Number.isFinite(angle)) return null;
  const [l1, l2, l3, l4] = unit;
  const [a, b, c] = grashofExcesses(unit);
  const product = 4 * l1 * l4;
  const halfSine = Math.sin(angle / 2);
  const sine2 = halfSine ** 2, cosine2 = Math.cos(angle / 2) ** 2;
  let x = c * (l1 + l2 + l3 + l4) + product * cosine2;
  const y = a * b + product * sine2;
  const r = Math.sqrt((l4 - l1) ** 2 + product * sine2);
  const longest = l2 + l3;
  if (c < 0 && product * cosine2 > longest ** 2) x = (longest - r) * (longest + r);
  if (!(x >= 0 && y >= 0 && r > 0)) return null;
  const longer = l1 > l4;
  const [big, small] = longer ? [l1, l4] : [l4, l1];
  let diagonal = Math.atan2(-small * Math.sin(angle) * (longer ? -1 : 1), big - small + 2 * small * halfSine ** 2);
  if (longer) diagonal += angle - Math.PI;
  const beside = (near, far) => {
    const difference = far - near;
    const larger = r + Math.abs(difference);
    const smaller = y / larger;
    const [ahead, behind] = difference >= 0 ? [larger, smaller] : [smaller, larger];
    const total = r + near + far;
    return 2 * Math.atan2(Math.sqrt((ahead * x) / total), Math.sqrt(behind * total));
  };
  return {
    coupler: diagonal + branch * beside(l2, l3),
    rocker: diagonal + Math.PI - branch * beside(l3, l2),
    transmission: 2 * Math.atan2(Math.sqrt(Math.min(x, y)), Math.sqrt(Math.max(x, y))),
  };
}

/** The whole turns to subtract from an angle curve so that its first sample lies in (-pi, pi]. */
function principalShift(first) {
  return TURN * Math.round((first - Math.atan2(Math.sin(first), Math.cos(first))) / TURN);
}

/**
 * The linkage of a solution in the service's reply, whose angles are in degrees.
 * at(travel): its joints after the crank has turned by `travel` radians from the first sample; null where it does not close.
 */
export class Linkage {
  constructor(solution) {
    const rad = Math.PI / 180;
    const { crank, coupler, rocker, ground } = solution.links;
    this.links = [crank, coupler, rocker, ground];
    this.branch = solution.branch;
    this.start = solution.start_angle * rad;
    this.mount = solution.mount;
    this.turn = solution.mount ? solution.mount.ground_angle * rad : 0;
    this.bodyOffset = (solution.body_offset ?? 0) * rad;
    this.a = solution.mount ? solution.mount.pivot_a : [0, 0];
    this.b = [this.a[0] + ground * Math.cos(this.turn), this.a[1] + ground * Math.sin(this.turn)];
    this.point = solution.mount ? [solution.mount.coupler_point.radius, solution.mount.coupler_point.angle * rad] : null;
    const first = closeLoop(this.links, this.branch, this.start);
    this.shift = first ? principalShift(first.coupler) : 0;
    this.turnsFully = turnsFully(this.links);
  }

  at(travel) {
    const angle = this.start + travel;
    const loop = closeLoop(this.links, this.branch, angle);
    if (!loop) return null;
    const crank = angle + this.turn;
    const coupler = loop.coupler - this.shift + this.turn;
    const [l1, l2] = this.links;
    const d = [this.a[0] + l1 * Math.cos(crank), this.a[1] + l1 * Math.sin(crank)];
    const c = [d[0] + l2 * Math.cos(coupler), d[1] + l2 * Math.sin(coupler)];
    let p = null;
    if (this.point) {
      const direction = this.point[1] + coupler;
      p = [d[0] + this.point[0] * Math.cos(direction), d[1] + this.point[0] * Math.sin(direction)];
    }
    return {
      travel, a: this.a, b: this.b, d, c, p, crank, coupler,
      rocker: loop.rocker + this.turn,
      rotation: coupler + this.bodyOffset,
      transmission: loop.transmission,
    };
  }

  /** Joints at steps + 1 even travels from `first` to `last`; nulls where the loop does not close. */
  over(first, last, steps = 180) {
    return Array.from({ length: steps + 1 }, (_, k) => this.at(first + ((last - first) * k) / steps));
  }
}
