// Chart: curves over an axis, with a cursor that is dragged.

import { fixed, setAttributes, svg } from "./dom.js";

const MARGIN = { left: 56, right: 10, top: 8, bottom: 36 };
/** Room for a letter of the upright axis's numbers, and for what lies left and right of them [px]. */
const LETTER = 7.6;
const LABEL = 24;

/**
 * Curves in axes. A curve is `{x, y, look}`, arrays of one length; `ranges` gives what is shown as
 * `{x: [low, high], y: [low, high]}`; `pick(x)` is told where the chart is pressed.
 */
export class Chart {
  constructor({ title, xLabel, yLabel, curves, pick, height = 170 }) {
    Object.assign(this, { xLabel, yLabel, curves, height, width: 420, left: MARGIN.left });
    this.axes = svg("g", { class: "axes" });
    this.frame = svg("rect");
    const clip = `inner-${Math.random().toString(36).slice(2)}`;
    this.paths = curves.map((curve) => svg("path", { class: `curve ${curve.look}` }));
    this.cursor = svg("line", { class: "cursor" });
    this.dots = curves.map((curve) => svg("circle", { r: 4, class: `dot ${curve.look}` }));
    this.element = svg(
      "svg",
      { class: "chart", role: "img" },
      svg("title", {}, title),
      this.axes,
      svg("clipPath", { id: clip }, this.frame),
      svg("g", { "clip-path": `url(#${clip})` }, ...this.paths, this.cursor),
      ...this.dots,
    );
    if (pick) this.listen(pick);
  }

  listen(pick) {
    this.element.classList.add("picks");
    const told = (event) => {
      const box = this.element.getBoundingClientRect();
      const share = ((event.clientX - box.left) * this.width) / box.width - this.left;
      const [low, high] = this.ranges.x;
      const x = low + (share / this.inner) * (high - low);
      pick(Math.min(Math.max(x, low), high));
    };
    this.element.addEventListener("pointerdown", (event) => {
      this.element.setPointerCapture(event.pointerId);
      told(event);
    });
    this.element.addEventListener("pointermove", (event) => {
      if (event.buttons & 1) told(event);
    });
  }

  get inner() {
    return this.width - this.left - MARGIN.right;
  }

  /** Draws axes and curves anew for ranges and a size [px]; the height stays if there is none. */
  show(ranges, width, height = this.height) {
    Object.assign(this, { width: Math.max(width, 200), height, ranges });
    this.ticksY = niceTicks(...ranges.y, (this.height - MARGIN.top - MARGIN.bottom) / 24);
    const letters = Math.max(...this.ticksY.map(({ text }) => text.length));
    this.left = Math.max(MARGIN.left, LABEL + LETTER * letters);
    this.element.setAttribute("viewBox", `0 0 ${this.width} ${this.height}`);
    this.drawAxes();
    this.curves.forEach((curve, k) => this.paths[k].setAttribute("d", this.path(curve)));
  }

  px(x) {
    const [low, high] = this.ranges.x;
    return this.left + ((x - low) / (high - low)) * this.inner;
  }

  py(y) {
    const [low, high] = this.ranges.y;
    const tall = this.height - MARGIN.top - MARGIN.bottom;
    return MARGIN.top + ((high - y) / (high - low)) * tall;
  }

  path({ x, y, ordered }) {
    let [first, last] = [0, x.length - 1];
    if (ordered) {
      const [low, high] = this.ranges.x;
      while (first < last && x[first + 1] < low) first++;
      while (last > first && x[last - 1] > high) last--;
    }
    let [path, column, letter] = ["", NaN, "M"];
    for (let k = first; k <= last; k++) {
      const [px, py] = [this.px(x[k]), this.py(y[k])];
      // Of many knots within a fifth of a pixel, those that turn and the last one are enough.
      const between = k > first && k < last;
      const turns = between && (y[k] - y[k - 1]) * (y[k + 1] - y[k]) < 0;
      if (ordered && between && !turns && this.px(x[k + 1]) - column < 0.2) continue;
      path += `${letter}${px.toFixed(1)} ${py.toFixed(1)}`;
      [column, letter] = [px, "L"];
    }
    return path;
  }

  drawAxes() {
    const [left, right] = [this.left, this.width - MARGIN.right];
    const [top, bottom] = [MARGIN.top, this.height - MARGIN.bottom];
    const parts = [];
    const ticksX = niceTicks(...this.ranges.x, this.inner / 45);
    for (const { at, text } of ticksX) {
      const x = this.px(at);
      const within = Math.min(x, this.width - 4 * text.length);
      parts.push(svg("line", { x1: x, x2: x, y1: top, y2: bottom }));
      parts.push(svg("text", { x: within, y: bottom + 14, "text-anchor": "middle" }, text));
    }
    for (const { at, text } of this.ticksY) {
      const y = this.py(at);
      parts.push(svg("line", { x1: left, x2: right, y1: y, y2: y }));
      parts.push(svg("text", { x: left - 5, y: y + 4, "text-anchor": "end" }, text));
    }
    const [middle, half] = [(left + right) / 2, (top + bottom) / 2];
    parts.push(svg("text", { x: middle, y: this.height - 5, "text-anchor": "middle" }, this.xLabel));
    const turned = { transform: `translate(11 ${half}) rotate(-90)`, "text-anchor": "middle" };
    parts.push(svg("text", turned, this.yLabel));
    this.axes.replaceChildren(...parts);
    const box = { x: left, y: top - 2, width: right - left, height: bottom - top + 4 };
    setAttributes(this.frame, box);
  }

  /** Moves the cursor to x, null for none, and a dot on each curve to its `[x, y]`. */
  mark(x, points) {
    const shown = x !== null && x >= this.ranges.x[0] && x <= this.ranges.x[1];
    this.cursor.style.display = shown ? "" : "none";
    if (shown) {
      const [x1, y2] = [this.px(x), this.height - MARGIN.bottom];
      setAttributes(this.cursor, { x1, x2: x1, y1: MARGIN.top, y2 });
    }
    points.forEach(([atX, atY], k) => {
      const [low, high] = this.ranges.y;
      const inside = Math.min(Math.max(atY, low), high);
      setAttributes(this.dots[k], { cx: this.px(atX), cy: this.py(inside) });
    });
  }
}

/** Round numbers within a range, about so many, with their text; a walk's first step is no gap. */
function niceTicks(low, high, count) {
  const rough = (high - low) / Math.max(count, 2);
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((k) => k * power).find((each) => each >= rough) ?? 10 * power;
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const ticks = [];
  for (let n = Math.ceil(low / step - 1e-3); n * step <= high + 1e-9 * step; n++) {
    ticks.push({ at: n * step, text: fixed(n * step, digits) });
  }
  return ticks;
}

/** The range of several arrays, with some room. */
export function rangeOf(arrays, room = 0.05) {
  let [low, high] = [Infinity, -Infinity];
  for (const values of arrays) {
    for (const value of values) [low, high] = [Math.min(low, value), Math.max(high, value)];
  }
  if (!(high > low)) [low, high] = [low - 1, low + 1];
  const more = room * (high - low);
  return [low - more, high + more];
}
