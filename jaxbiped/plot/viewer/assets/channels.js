// Channels of a walk: decoding them, and their values between knots.

/** A walk as it was sent, numbers decoded where they are text: `t` [s] and `channels`, all of one length. */
export function decodeWalk(sent) {
  const t = decode(sent.t, Float64Array);
  const channels = {};
  for (const [name, text] of Object.entries(sent.channels)) {
    channels[name] = decode(text, Float32Array);
  }
  return { ...sent, t, channels, start: t[0], end: t[t.length - 1] };
}

function decode(text, Kind) {
  if (typeof text !== "string") return text;
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return new Kind(bytes.buffer);
}

/** The last knot at or before a time, never the very last one. */
export function knotBefore(t, time) {
  let low = 0;
  let high = t.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (t[middle] <= time) low = middle;
    else high = middle;
  }
  return low;
}

/** A time brought into a walk. */
export function within(walk, time) {
  return Math.min(Math.max(time, walk.start), walk.end);
}

/** A channel between its knots, straight. */
export function linear(walk, name, time) {
  const values = walk.channels[name];
  if (!values) return 0;
  const k = knotBefore(walk.t, time);
  const share = (time - walk.t[k]) / (walk.t[k + 1] - walk.t[k]);
  return values[k] + share * (values[k + 1] - values[k]);
}

/** A coordinate at a time: Hermite's cubic through values and rates at the knots. */
export function hermite(walk, name, rateName, time) {
  const [values, rates] = [walk.channels[name], walk.channels[rateName]];
  const k = knotBefore(walk.t, time);
  const h = walk.t[k + 1] - walk.t[k];
  const s = (time - walk.t[k]) / h;
  const [rise, left, right] = [values[k + 1] - values[k], h * rates[k], h * rates[k + 1]];
  const square = 3 * rise - 2 * left - right;
  const cube = left + right - 2 * rise;
  return values[k] + s * (left + s * (square + s * cube));
}
