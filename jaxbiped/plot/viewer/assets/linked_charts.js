// Linked charts: angles, phase portrait, forces and energies of a walk, with one cursor.

import { linear, within } from "./channels.js";
import { Chart, rangeOf } from "./chart.js";
import { html } from "./dom.js";

const ENERGIES = {
  kinetic: "kinetic", elastic: "elastic", supplied: "gravity's work", driven: "motors' work",
  lost: "lost",
};

/** What is drawn of a walk: each chart with its curves, `{name, label, look}`. */
function chartsOf({ skeleton }) {
  const { noun, parts, feet } = skeleton;
  const turning = parts.map(({ name, label, look }) => ({ body: name, name: `theta_${name}`, label, look }));
  const loads = (kind) =>
    feet.map(({ label, look }, k) => ({ name: `${kind}_${k + 1}`, label, look }));
  const energies = Object.entries(ENERGIES).map(([name, label]) => ({ name, label, look: name }));
  const angle = `${noun} angle (rad)`;
  return [
    { title: `${noun[0].toUpperCase()}${noun.slice(1)} angles`, y: angle, curves: turning },
    { title: "Phase portrait", x: angle, y: `${noun} rate (rad/s)`, portrait: true, curves: turning },
    { title: "Normal forces", y: "force (N)", curves: loads("normal") },
    { title: "Tangential forces", y: "downhill force (N)", curves: loads("tangential") },
    { title: "Energies", y: "energy (J)", curves: energies },
  ];
}

/** The charts of one walk. `walks` are all that are shown: they share their ranges. */
export class LinkedCharts {
  constructor(walk, walks, pick) {
    this.walk = walk;
    const there = chartsOf(walk).filter(({ curves }) => curves.some(({ name }) => walk.channels[name]));
    this.charts = there.map((each) => this.build(each, walks, pick));
    this.element = html("div", { class: "charts" }, ...this.charts.map((each) => each.figure));
  }

  build(about, walks, pick) {
    const { walk } = this;
    const known = about.curves.filter(({ name }) => walk.channels[name]);
    const curves = known.map((each) =>
      about.portrait ? portraitCurve(walk, each) : timeCurve(walk, each),
    );
    const label = { xLabel: about.x ?? "time (s)", yLabel: about.y };
    const title = `${walk.name}: ${about.title}`;
    const chart = new Chart({ ...label, title, curves, pick: about.portrait ? null : pick });
    const all = (prefix) => {
      const names = (each) => each.skeleton.parts.map(({ name }) => `${prefix}_${name}`);
      return walks.flatMap((each) => names(each).map((name) => each.channels[name]));
    };
    const same = walks.flatMap(({ channels }) => known.map(({ name }) => channels[name]));
    const y = rangeOf(about.portrait ? all("omega") : same.filter(Boolean));
    const x = about.portrait && rangeOf(all("theta"));
    const key = known.map(({ label: words }, k) => keyEntry(curves[k].look, words));
    const caption = html("figcaption", {}, about.title, html("span", { class: "key" }, ...key));
    const figure = html("figure", {}, caption, chart.element);
    return { about, known, chart, figure, x, y };
  }

  /** Widths and heights that the page gives the charts [px]. */
  sizes() {
    return this.charts.map(({ chart }) => {
      const { width, height } = chart.element.getBoundingClientRect();
      return width && height ? [Math.round(width), Math.round(height)] : [420, 170];
    });
  }

  /** Draws everything in these sizes and for a span of time [s]. */
  show(sizes, span) {
    this.span = span ?? null;
    this.charts.forEach(({ chart, x, y }, k) => chart.show({ x: x || this.window(), y }, ...sizes[k]));
  }

  window() {
    return this.span ?? [this.walk.start, this.walk.end];
  }

  mark(time) {
    const t = within(this.walk, time);
    const at = (name) => linear(this.walk, name, t);
    for (const { about, known, chart } of this.charts) {
      const points = known.map(({ name, body }) =>
        about.portrait ? [at(name), at(`omega_${body}`)] : [t, at(name)],
      );
      chart.mark(about.portrait ? null : t, points);
    }
  }
}

function timeCurve(walk, { name, look }) {
  return { x: walk.t, y: walk.channels[name], look, ordered: true };
}

function portraitCurve(walk, { name, body, look }) {
  return { x: walk.channels[name], y: walk.channels[`omega_${body}`], look: `${look} whole` };
}

function keyEntry(look, words) {
  return html("span", {}, html("span", { class: `sample ${look}`, "aria-hidden": "true" }), words);
}
