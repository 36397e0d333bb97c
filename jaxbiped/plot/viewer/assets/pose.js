// Poses: where the walker is at a time, gravity down the page.

import { hermite, linear, within } from "./channels.js";

/** A point of the slope's frame [m] on the page: to the right, and downwards as SVG counts. */
export function onPage(walk, x, z) {
  const [sine, cosine] = [Math.sin(walk.slope), Math.cos(walk.slope)];
  return [cosine * x + sine * z, sine * x - cosine * z];
}

/** Everything that is drawn or told of a walk at a time [s], lengths in m, forces in N. */
export function poseAt(walk, time) {
  const t = within(walk, time);
  const x = hermite(walk, "hip_x", "hip_vx", t);
  const z = hermite(walk, "hip_z", "hip_vz", t);
  const legs = [1, 2].map((leg) => {
    const angle = hermite(walk, `theta_${leg}`, `omega_${leg}`, t);
    const foot = [
      x + (walk.l - walk.r) * Math.sin(angle),
      z - (walk.l - walk.r) * Math.cos(angle),
    ];
    return {
      angle,
      rate: linear(walk, `omega_${leg}`, t),
      centre: onPage(walk, ...foot),
      place: foot[0],
      normal: linear(walk, `normal_${leg}`, t),
      tangential: linear(walk, `tangential_${leg}`, t),
    };
  });
  return { t, x, hip: onPage(walk, x, z), legs, ended: time >= walk.end };
}

/** How many heel strikes there were until a time. */
export function strikesUntil(walk, time) {
  return walk.footprints.filter((print) => print.strike && print.t <= time).length;
}
