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
    this.at = { fields: take(13), queue: take(1), stop: take(1), counts: take(1) };
    Object.assign(this.at, { inputs: take(sent.inputs.length), outputs: take(64) });
    this.at.records = take(sent.room * sent.recorded.length);
    memory.grow(Math.ceil((end - STACK) / PAGE));
    this.integers = new BigInt64Array(memory.buffer);
    this.floats = new Float64Array(memory.buffer);
    const { queue, stop, inputs, outputs, records, counts } = this.at;
    const fields = [numbers.count, queue, stop, inputs, outputs, records, counts, numbers.room];
    fields.forEach((value, k) => (this.integers[this.at.fields / 8 + k] = BigInt(value)));
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
    const { recorded, endings, l, r, weight } = this.sent;
    const channels = {};
    recorded.forEach((name, k) => {
      channels[name] = Float64Array.from({ length: count }, (_, n) => rows[n * recorded.length + k]);
    });
    const [height, total] = [channels.gravitational, totalEnergy(channels)];
    channels.supplied = height.map((value) => height[0] - value);
    channels.lost = total.map((value) => total[0] - value);
    const footprints = heelStrikes(channels);
    const told = { name: "your walk", ending: endings[code], driven: false };
    return { ...told, slope, l, r, weight, t: channels.t, channels, footprints };
  }
}

function totalEnergy({ kinetic, gravitational, elastic }) {
  return kinetic.map((value, k) => value + gravitational[k] + elastic[k]);
}

/** The foot ahead comes to touch, the other one having struck before. */
function heelStrikes({ t, touches_1, touches_2, place_1, place_2 }) {
  const [touches, places, found] = [[touches_1, touches_2], [place_1, place_2], []];
  const alone = [0, 1].filter((foot) => touches[foot][0]);
  let last = alone.length === 1 ? alone[0] : -1;
  for (const foot of alone) found.push({ t: t[0], foot: foot + 1, x: places[foot][0], strike: false });
  for (let k = 1; k < t.length; k++) {
    for (const foot of [0, 1]) {
      const lands = !touches[foot][k - 1] && touches[foot][k];
      if (!lands || foot === last || places[foot][k] <= places[1 - foot][k]) continue;
      found.push({ t: t[k], foot: foot + 1, x: places[foot][k], strike: true });
      last = foot;
    }
  }
  return found;
}
