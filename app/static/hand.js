// A linkage changed by hand: from joints that were dragged to its dimensions, its crank angles at the poses and its errors.

import { fitOf } from "./fit.js";
import { drivePlaces, driveTurns } from "./drive.js";
import { Linkage, family } from "./kinematics.js";
import { placeOf, placesOf, wantsAngles, wantsPlaces } from "./motion.js";
import { RAD, add, along, cross, direction, dot, less, size, turned } from "./plane.js";
import { angleError } from "./timing.js";

const DEG = 180 / Math.PI;
const BEYOND = 40; // degrees beyond the former crank angles within which new ones are looked for
const GRID = 1; // degrees between crank angles that are compared
const REFINEMENTS = 30; // golden sections of one step of the grid
const COINCIDE = 1e-9; // joints this part of the longest link apart are one
const GOLDEN = (Math.sqrt(5) - 1) / 2;

const wrap = (angle) => Math.atan2(Math.sin(angle), Math.cos(angle));

/**
 * The solution whose joints, with the crank turned by `travel` degrees from its start, are `joints` ({a, b, c, d, p, rotation});
 * the body keeps its direction. Null where two joints coincide.
 */
export function fromJoints(joints, travel, before) {
  return before.links ? fourBarFrom(joints, travel, before) : guidedFrom(joints, travel, before);
}

/** The guides that lie as joints {a, b, c, d, p, rotation} say, and where the drive then is; null for what is none. */
function guidesFrom({ a, b, c, d, p, rotation }, { guides, driver }) {
  const made = [
    [a, d],
    [b, c],
  ].map(([fixed, held], k) => {
    const { guide } = guides[k],
      reach = less(held, fixed),
      local = turned(less(held, p), -rotation);
    if (!(size(reach) > 0)) return null;
    if (guide === "circle") return { guide, pivot: fixed, radius: size(reach), body_point: local };
    if (guide === "rail") {
      const old = guides[k].direction,
        found = direction(less(fixed, held)) / RAD;
      return {
        guide,
        point: held,
        direction: found + 180 * Math.round((old - found) / 180),
        body_point: local,
        used: null,
      };
    }
    const old = guides[k].body_direction,
      found = (direction(reach) - rotation) / RAD;
    return {
      guide,
      pin: fixed,
      body_point: turned(less(fixed, p), -rotation),
      body_direction: found + 180 * Math.round((old - found) / 180),
      used: null,
    };
  });
  if (!made.every(Boolean)) return null;
  const [driven, other] = made,
    place = (one) => add(p, turned(one.body_point, rotation));
  const slot = (one) => one.body_direction * RAD + rotation;
  const start = {
    crank: () => direction(less(place(driven), driven.pivot)) / RAD,
    slider: () => 0,
    cylinder: () => 0,
    hinge: () => slot(driven) / RAD,
  }[driver]();
  const push =
    other.guide === "circle"
      ? less(place(other), other.pivot)
      : other.guide === "rail"
        ? turned(along(other.direction * RAD), Math.PI / 2)
        : turned(along(slot(other)), Math.PI / 2);
  const at = other.guide === "slot" ? other.pin : place(other),
    pin = driven.guide === "slot" ? driven.pin : place(driven);
  const sine = driver === "hinge" ? dot(push, along(slot(driven))) : cross(less(at, pin), push);
  return { guides: made, start, branch: sine < 0 ? -1 : 1 };
}

/** Guides with the parts of rails and slots that poses (joints of `at`) use. */
function withUsed(linkage, joints) {
  return linkage.guides.map(({ fixed, body, angle, ...one }) => {
    if (one.guide === "circle") return one;
    const places = joints.filter(Boolean).map((j) => {
      const held = add(j.p, turned(body, j.rotation));
      return one.guide === "rail"
        ? dot(along(angle), less(held, fixed))
        : dot(along(angle + j.rotation), less(fixed, held));
    });
    return { ...one, used: places.length ? [Math.min(...places), Math.max(...places)] : null };
  });
}

/** The same of a linkage with rails or slots: each guide goes through its two joints. */
function guidedFrom(joints, travel, before) {
  const found = guidesFrom(joints, before);
  if (!found) return null;
  const made = {
    ...before,
    source: "hand",
    rank: null,
    ...found,
    start: found.start - travel,
    verdict: null,
    analysis: null,
    tolerance_study: null,
    rounded: null,
    excursion: null,
    transmission_angle_min_turn: null,
    arm_min: null,
    determination: null,
  };
  return new Linkage(made).at(travel / DEG) && made;
}

function fourBarFrom({ a, b, c, d, p, rotation }, travel, before) {
  const links = {
    crank: size(less(d, a)),
    coupler: size(less(c, d)),
    rocker: size(less(c, b)),
    ground: size(less(b, a)),
  };
  const lengths = Object.values(links);
  if (!(Math.min(...lengths) > COINCIDE * Math.max(...lengths))) return null;
  const turn = direction(less(b, a)),
    side = (b[0] - d[0]) * (c[1] - d[1]) - (b[1] - d[1]) * (c[0] - d[0]);
  const made = {
    ...before,
    source: "hand",
    rank: null,
    links,
    branch: side < 0 ? -1 : 1,
    start_angle: wrap(direction(less(d, a)) - turn) * DEG - travel,
    body_offset: 0,
    mount: {
      ground_angle: turn * DEG,
      pivot_a: a,
      pivot_b: b,
      coupler_point_polar: p
        ? { radius: size(less(p, d)), angle: wrap(direction(less(p, d)) - direction(less(c, d))) * DEG }
        : null,
    },
    family: family(lengths),
    verdict: null,
    rounded: null,
    analysis: null,
    tolerance_study: null,
    excursion: null,
    transmission_angle_min_turn: null,
    determination: { ill_posed: false, active_limits: [] },
  };
  const now = new Linkage(made).at(travel / DEG);
  return now && { ...made, body_offset: before.body_offset === null ? null : (rotation - now.coupler) * DEG };
}

/** The square error of pose k where the linkage has `joints`; infinite where it does not close. */
function squareError(motion, k, joints, scale) {
  if (!joints) return Infinity;
  const pose = motion.poses[k],
    place = wantsPlaces(motion) ? placeOf(pose) : null;
  const off = place && joints.p ? size(less(joints.p, place)) / scale : 0;
  const missed =
    wantsAngles(motion) && pose.angle !== null ? angleError(motion, pose.angle, joints.rotation * DEG) / DEG : 0;
  return off ** 2 + missed ** 2;
}

/** The crank angle near `angle` at which pose k is met best, by golden sections. */
function sharpened(linkage, motion, k, angle, scale, step) {
  let [low, high] = [angle - step, angle + step];
  const error = (at) => squareError(motion, k, linkage.at(at / DEG), scale);
  for (let n = 0; n < REFINEMENTS; n++) {
    const [left, right] = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
    if (error(left) < error(right)) high = right;
    else low = left;
  }
  const best = (low + high) / 2;
  return error(best) <= error(angle) ? best : angle;
}

/** Crank angles from the start at which a linkage meets the poses best, near the former ones. */
function crankAngles(solution, motion, scale) {
  const linkage = new Linkage(solution),
    former = drivePlaces(solution),
    span = Math.max(...former) - Math.min(...former);
  // a slider's or cylinder's way is looked at in as many steps as a crank's quarter turn
  const [beyond, step] = driveTurns(solution) ? [BEYOND, GRID] : [0.4 * span, span / 90];
  const sense = former.at(-1) < 0 && !motion.anyOrder ? -1 : 1,
    ends = [Math.min(...former) - beyond, Math.max(...former) + beyond];
  const grid = Array.from({ length: Math.ceil((ends[1] - ends[0]) / step) + 1 }, (_, n) =>
    sense > 0 ? ends[0] + n * step : ends[1] - n * step,
  );
  const joints = grid.map((angle) => linkage.at(angle / DEG));
  const costs = motion.poses.map((_, k) => joints.map((one) => squareError(motion, k, one, scale)));
  if (motion.anyOrder)
    return costs.map((row, k) => sharpened(linkage, motion, k, grid[row.indexOf(Math.min(...row))], scale, step));
  // the least sum over angles that go one way: sums[n] of the best way that has come to at most grid point n
  const from = [];
  let sums = grid.map(() => 0);
  for (const row of costs) {
    let best = Infinity,
      at = 0;
    const trail = [];
    sums = sums.map((before, n) => {
      if (before + row[n] < best) [best, at] = [before + row[n], n];
      trail.push(at);
      return best;
    });
    from.push(trail);
  }
  let n = grid.length - 1;
  const chosen = [...costs.keys()]
    .reverse()
    .map((k) => {
      n = from[k][n];
      return grid[n];
    })
    .reverse();
  return chosen.map((angle, k) => sharpened(linkage, motion, k, angle, scale, step));
}

const rms = (values) => {
  const given = values.filter((value) => value !== null);
  return given.length ? Math.sqrt(given.reduce((sum, value) => sum + value ** 2, 0) / given.length) : null;
};
const largest = (values) => {
  const given = values.filter((value) => value !== null);
  return given.length ? Math.max(...given.map(Math.abs)) : null;
};

const middleOf = (places) => [0, 1].map((i) => places.reduce((sum, place) => sum + place[i], 0) / (places.length || 1));
const scaleOf = (places) => Math.max(...places.map((place) => size(less(place, middleOf(places)))), Number.MIN_VALUE);

/** A solution with errors, transmission angle and size computed in the browser, and whether it `closes` all along; with its `fit`. */
export function measured(solution, motion) {
  const places = placesOf(motion),
    middle = middleOf(places),
    scale = scaleOf(places),
    fit = fitOf(solution, motion),
    { pass } = fit;
  const used = fit.linkage.over((pass.sense * pass.low) / DEG, (pass.sense * pass.high) / DEG, 90),
    closes = used.every(Boolean) && fit.at.every(Boolean);
  const made = solution.links ? solution : { ...solution, guides: withUsed(fit.linkage, used) };
  const { mount } = made,
    reach =
      mount &&
      Math.max(
        ...Object.values(made.links),
        mount.coupler_point_polar?.radius ?? 0,
        size(less(mount.pivot_a, middle)),
        size(less(mount.pivot_b, middle)),
      );
  const squares = [
    rms(fit.places) === null ? 0 : (rms(fit.places) / scale) ** 2,
    rms(fit.turns) === null ? 0 : (rms(fit.turns) / DEG) ** 2,
  ];
  return {
    fit,
    closes,
    solution: {
      ...made,
      size: places.length && mount ? reach / scale : null,
      transmission_angle_min: used.every(Boolean) ? Math.min(...used.map((j) => j.transmission)) * DEG : 0,
      errors: {
        position_rms: rms(fit.places),
        position_max: largest(fit.places),
        rotation_rms: rms(fit.turns),
        rotation_max: largest(fit.turns),
        objective: Math.sqrt(squares[0] + squares[1]),
      },
    },
  };
}

/** The same with crank angles found anew where they are free, the start `shift` degrees further on. */
export function assessed(solution, motion) {
  if (motion.timing !== "free" || !drivePlaces(solution)) return { shift: 0, ...measured(solution, motion) };
  const angles = crankAngles(solution, motion, scaleOf(placesOf(motion))),
    own = solution.crank_angle ? "crank_angle" : "travel",
    begin = solution.links ? "start_angle" : "start",
    [shift] = angles;
  return {
    shift,
    ...measured({ ...solution, [begin]: solution[begin] + shift, [own]: angles.map((angle) => angle - shift) }, motion),
  };
}

/** A request to refine a solution from just there. */
export function fromHere(
  { diverse: _diverse, prefer: _prefer, mechanisms: _mechanisms, ...request },
  { links, branch, start_angle, body_offset, mount, crank_angle },
) {
  return {
    ...request,
    top: 1,
    local: true,
    start_from: [{ links, branch, start_angle, body_offset, mount, crank_angle }],
  };
}

/** A request for linkages whose pivots lie near those of a solution: within `share` of the motion's extent. */
export function nearby(request, solution, share = 0.05) {
  const xs = request.position.filter(Boolean),
    extent = Math.max(...[0, 1].map((i) => Math.max(...xs.map((p) => p[i])) - Math.min(...xs.map((p) => p[i]))));
  const around = ([x, y]) =>
    [x - share * extent, y - share * extent, x + share * extent, y + share * extent].map((value) =>
      Number(value.toPrecision(6)),
    );
  // boxes of their own take the place of whatever else was said of the pivots
  const { pivot_a: _a, pivot_b: _b, pivot_box: _box, ...limits } = request.limits ?? {};
  const { mechanisms: _mechanisms, ...asked } = request;
  return {
    ...asked,
    limits: { ...limits, pivot_a_box: around(solution.mount.pivot_a), pivot_b_box: around(solution.mount.pivot_b) },
  };
}
