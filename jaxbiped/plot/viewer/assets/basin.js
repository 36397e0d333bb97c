// Basin: labels of starts in two coordinates; a start that is picked shows its walk.

import { Chart } from "./chart.js";
import { html, setAttributes, svg } from "./dom.js";
import { setColours, showWalks } from "./view.js";

const TALL = 340;
const HELP =
  "Click on a start, or move with the arrow keys, to see its walk. " +
  "This page holds the walks of evenly spaced starts and shows that of the nearest.";

/** The picture with its legend, and the walk of the start that is picked below it. */
export class Basin {
  constructor(sent, el) {
    const { basin } = sent;
    Object.assign(this, { sent, basin, shown: null });
    this.cells = Uint8Array.from(atob(basin.cells), (letter) => letter.charCodeAt(0));
    this.edges = { x: edgesOf(basin.x), y: edgesOf(basin.y) };
    this.chart = new Chart({
      title: basin.title, xLabel: basin.xLabel, yLabel: basin.yLabel, curves: [], height: TALL,
    });
    this.image = svg("image", { preserveAspectRatio: "none" });
    this.rings = ["outer", "inner"].map((look) => svg("circle", { r: 6, class: `ring ${look}` }));
    this.chart.element.append(this.image, ...this.rings);
    setAttributes(this.chart.element, {
      tabindex: 0, role: "application", "aria-label": `${basin.title}. ${HELP}`,
    });
    this.chart.element.addEventListener("pointerdown", (event) => this.press(event));
    this.chart.element.addEventListener("keydown", (event) => this.key(event));
    this.told = html("p", { class: "told", "aria-live": "polite" });
    this.below = html("div", { class: "below" });
    const legend = html("ul", { class: "legend" }, ...basin.names.map((name, k) => this.entry(name, k)));
    const root = html(
      "div",
      { class: "jaxbiped-view basin" },
      html("h2", {}, basin.title),
      html("p", { class: "note" }, HELP),
      html("div", { class: "picture" }, this.chart.element, legend, this.told),
      this.below,
    );
    setColours(root, sent.colours);
    el.replaceChildren(root);
    new ResizeObserver(() => this.draw()).observe(this.chart.element.parentElement);
    this.pick(...basin.first);
  }

  entry(name, k) {
    const share = this.cells.reduce((count, cell) => count + (cell === k), 0) / this.cells.length;
    const swatch = html("span", { class: "swatch", style: `background: ${this.basin.colours[k]}` });
    return html("li", {}, swatch, `${name}: ${(100 * share).toFixed(1)} %`);
  }

  draw() {
    const { chart, edges, basin } = this;
    const span = (all) => [all[0], all.at(-1)];
    chart.show({ x: span(edges.x), y: span(edges.y) }, chart.element.parentElement.clientWidth);
    const [left, right] = span(edges.x).map((x) => chart.px(x));
    const [bottom, top] = span(edges.y).map((y) => chart.py(y));
    const canvas = html("canvas", { width: Math.ceil(right - left), height: Math.ceil(bottom - top) });
    const brush = canvas.getContext("2d");
    const [xs, ys] = [edges.x.map((x) => chart.px(x) - left), edges.y.map((y) => chart.py(y) - top)];
    this.cells.forEach((cell, place) => {
      const [i, j] = [place % basin.x.length, Math.floor(place / basin.x.length)];
      brush.fillStyle = basin.colours[cell];
      brush.fillRect(xs[i], ys[j + 1], xs[i + 1] - xs[i] + 0.5, ys[j] - ys[j + 1] + 0.5);
    });
    const box = { x: left, y: top, width: right - left, height: bottom - top };
    setAttributes(this.image, { href: canvas.toDataURL(), ...box });
    this.mark();
  }

  mark() {
    if (!this.chart.ranges) return;
    const { basin, chart } = this;
    const [cx, cy] = [chart.px(basin.x[this.at.i]), chart.py(basin.y[this.at.j])];
    this.rings.forEach((ring) => setAttributes(ring, { cx, cy }));
    chart.mark(null, []);
  }

  press(event) {
    const box = this.chart.element.getBoundingClientRect();
    const scale = this.chart.width / box.width;
    const [px, py] = [(event.clientX - box.left) * scale, (event.clientY - box.top) * scale];
    const { x, y, columns, rows } = this.basin;
    this.pick(
      nearest(columns.map((i) => this.chart.px(x[i])), px),
      nearest(rows.map((j) => this.chart.py(y[j])), py),
    );
  }

  key(event) {
    const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowDown: [0, -1], ArrowUp: [0, 1] };
    const move = moves[event.key];
    if (!move) return;
    const last = [this.basin.columns.length - 1, this.basin.rows.length - 1];
    const [c, r] = [this.at.c, this.at.r].map((at, k) => Math.min(Math.max(at + move[k], 0), last[k]));
    this.pick(c, r);
    event.preventDefault();
  }

  /** Shows the walk of a kept start, by its column and row among them. */
  pick(c, r) {
    const { basin, sent } = this;
    const [i, j] = [basin.columns[c], basin.rows[r]];
    this.at = { c, r, i, j };
    this.mark();
    const label = basin.names[this.cells[j * basin.x.length + i]];
    const told = (words, value) => `${words}: ${value.toPrecision(4).replace("-", "−")}`;
    const place = `${told(basin.xLabel, basin.x[i])}, ${told(basin.yLabel, basin.y[j])}`;
    this.told.textContent = `${place}; ${label}.`;
    this.shown?.stop();
    const walk = sent.walks[r * basin.columns.length + c];
    const autoplay = this.shown !== null;
    this.shown = null;
    if (walk) {
      this.shown = showWalks({ ...sent, walks: [{ ...walk, name: label }] }, this.below, { autoplay });
    } else {
      this.below.replaceChildren(html("p", {}, "This start cannot be simulated."));
    }
  }
}

function edgesOf(centres) {
  const between = centres.slice(1).map((x, k) => (x + centres[k]) / 2);
  const last = centres.length - 1;
  return [
    centres[0] - (between[0] - centres[0]),
    ...between,
    centres[last] + (centres[last] - between.at(-1)),
  ];
}

function nearest(places, at) {
  let best = 0;
  places.forEach((place, k) => {
    if (Math.abs(place - at) < Math.abs(places[best] - at)) best = k;
  });
  return best;
}
