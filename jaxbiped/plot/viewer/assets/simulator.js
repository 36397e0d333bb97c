// Simulator: walks in the page itself, by the lanes' program as WebAssembly.

/** Where the module's stack begins, downwards; its numbers lie behind [bytes]. */
const STACK = 1 << 20;
const PAGE = 65536;

/** Compiles what a playground was sent; `run(inputs)` then gives a walk as the viewer plays it. */
export async function makeSimulator(sent) {
  const memory = new WebAssembly.Memory({ initial: STACK / PAGE });
  const pointer = new WebAssembly.Global({ value: "i32", mutable: true }, STACK);
  const { sin, cos, log, pow } = Math;
  const env = { __linear_memory: memory, __stack_pointer: pointer, sin, cos, log, pow };
  const bytes = Uint8Array.from(atob(sent.module), (letter) => letter.charCodeAt(0));
  const { instance } = await WebAssembly.instantiate(bytes, { env });
  return new Simulator(sent, memory, instance.exports.jaxbiped_run);
}

class Simulator {
  constructor(sent, memory, entry) {
    Object.assign(this, { sent, memory, entry });
    let end = STACK;
    const take = (count) => {
      const place = end;
      end += 8 * count;
      return place;
    };
    const numbers = { count: 1, room: sent.room };
    this.at = { fields: take(15), queue: take(1), stop: take(1), counts: take(1) };
    const many = sent.inputs.length;
    Object.assign(this.at, { inputs: take(many), places: take(many), outputs: take(64) });
    this.at.records = take(sent.room * sent.recorded.length);
    memory.grow(Math.ceil((end - STACK) / PAGE));
    this.integers = new BigInt64Array(memory.buffer);
    this.floats = new Float64Array(memory.buffer);
    const { queue, stop, inputs, outputs, records, counts } = this.at;
    const fields = [numbers.count, queue, stop, inputs, outputs, records, counts, numbers.room];
    fields.forEach((value, k) => (this.integers[this.at.fields / 8 + k] = BigInt(value)));
    for (let k = 0; k < many; k++) this.integers[this.at.places / 8 + k] = BigInt(k);
    // Of a single walk, steps from one to the next do not count.
    for (const k of [13, 14]) this.integers[this.at.fields / 8 + k] = BigInt(this.at.places);
  }

  /** The numbers recorded of a solve, row by row, and how it ended. */
  solve(inputs) {
    for (const name of ["queue", "stop", "counts"]) this.integers[this.at[name] / 8] = 0n;
    this.floats.set(inputs, this.at.inputs / 8);
    this.entry(this.at.fields);
    const count = Math.min(Number(this.integers[this.at.counts / 8]), this.sent.room);
    const first = this.at.records / 8;
    const rows = this.floats.slice(first, first + count * this.sent.recorded.length);
    const code = this.floats[this.at.outputs / 8 + this.sent.ending];
    return { rows, count, code };
  }

  /** A walk; null where not even two steps were possible. */
  run(inputs, slope) {
    const { rows, count, code } = this.solve(inputs);
    if (count < 2) return null;
    const { recorded, endings, skeleton, weight } = this.sent;
    const channels = {};
    recorded.forEach((name, k) => {
      channels[name] = Float64Array.from({ length: count }, (_, n) => rows[n * recorded.length + k]);
    });
    const [height, total] = [channels.gravitational, totalEnergy(channels)];
    channels.supplied = height.map((value) => height[0] - value);
    const { t, power } = channels;
    if (power) {
      let work = 0;
      const gained = (k) => 0.5 * (power[k] + power[k - 1]) * (t[k] - t[k - 1]);
      channels.driven = power.map((_, k) => (k ? (work += gained(k)) : 0));
    }
    channels.lost = total.map((value, k) => total[0] - value + (channels.driven?.[k] ?? 0));
    const footprints = heelStrikes(channels, skeleton);
    const plain = { name: "your walk", ending: endings[code], driven: Boolean(power) };
    return { ...plain, slope, skeleton, weight, t, channels, footprints };
  }
}

function totalEnergy({ kinetic, gravitational, elastic }) {
  return kinetic.map((value, k) => value + gravitational[k] + elastic[k]);
}

/** The leg ahead of all others that carry comes to touch, another one having struck before. */
function heelStrikes(channels, { feet, legs }) {
  const { t } = channels;
  const own = legs.map((_, leg) => feet.map((_, k) => k + 1).filter((k) => feet[k - 1].leg === leg));
  const touching = (leg, k) => own[leg].filter((foot) => channels[`touches_${foot}`][k]);
  const place = (feetOf, k) =>
    feetOf.reduce((sum, foot) => sum + channels[`place_${foot}`][k], 0) / feetOf.length;
  const every = legs.map((_, leg) => leg);
  const standing = every.filter((leg) => touching(leg, 0).length);
  let last = standing.length === 1 ? standing[0] : -1;
  const print = (leg, k, strike) => ({ t: t[k], leg: leg + 1, x: place(touching(leg, k), k), strike });
  const found = standing.length === 1 ? [print(last, 0, false)] : [];
  for (let k = 1; k < t.length; k++) {
    for (const leg of every) {
      if (touching(leg, k - 1).length || !touching(leg, k).length) continue;
      const others = every.filter((other) => other !== leg);
      const carry = others.filter((other) => touching(other, k).length);
      const behind = (other) => place(own[leg], k) > place(own[other], k);
      const ahead = (carry.length ? carry : others).every(behind);
      if (!ahead || (leg === last && others.length)) continue;
      found.push(print(leg, k, true));
      last = leg;
    }
  }
  return found;
}
