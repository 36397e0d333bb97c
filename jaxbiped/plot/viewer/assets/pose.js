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
  const { root, parts, feet } = walk.skeleton;
  const [x, z] = ["x", "z"].map((name) => hermite(walk, `${root}_${name}`, `${root}_v${name}`, t));
  const bodies = [];
  for (const { name, parent, hinge, path, centre } of parts) {
    const angle = hermite(walk, `theta_${name}`, `omega_${name}`, t);
    const start = parent < 0 ? [x, z] : pointOf(bodies[parent], hinge);
    const body = { start, angle, sine: Math.sin(angle), cosine: Math.cos(angle) };
    const seen = (place) => onPage(walk, ...pointOf(body, place));
    bodies.push({ ...body, hinge: onPage(walk, ...start), path: path.map(seen), centre: seen(centre) });
  }
  const soles = feet.map(({ part, centre }, k) => {
    const place = pointOf(bodies[part], centre);
    return {
      centre: onPage(walk, ...place),
      place: place[0],
      normal: linear(walk, `normal_${k + 1}`, t),
      tangential: linear(walk, `tangential_${k + 1}`, t),
    };
  });
  return { t, x, root: onPage(walk, x, z), bodies, feet: soles, ended: time >= walk.end };
}

/** A point of a body in the slope's frame: so far down the body, so far ahead. */
function pointOf({ start, sine, cosine }, [along, ahead]) {
  return [start[0] + along * sine + ahead * cosine, start[1] - along * cosine + ahead * sine];
}

/** How many heel strikes there were until a time. */
export function strikesUntil(walk, time) {
  return walk.footprints.filter((print) => print.strike && print.t <= time).length;
}
