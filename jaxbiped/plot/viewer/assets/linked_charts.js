// Linked charts: legs, phase portrait, forces and energies of a walk, with one cursor.

import { linear, within } from "./channels.js";
import { Chart, rangeOf } from "./chart.js";
import { html } from "./dom.js";

const CHARTS = [
  { title: "Leg angles", y: "leg angle (rad)", curves: { theta_1: "leg-1", theta_2: "leg-2" } },
  { title: "Phase portrait", x: "leg angle (rad)", y: "leg rate (rad/s)", portrait: true },
  {
    title: "Normal forces",
    y: "force (N)",
    most: mostForce,
    curves: { normal_1: "leg-1", normal_2: "leg-2" },
  },
  {
    title: "Tangential forces",
    y: "downhill force (N)",
    most: mostForce,
    curves: { tangential_1: "leg-1", tangential_2: "leg-2" },
  },
  {
    title: "Energies",
    y: "energy (J)",
    most: mostEnergy,
    curves: {
      kinetic: "kinetic", elastic: "elastic", supplied: "supplied", lost: "lost",
    },
  },
];
const ENERGY_NAMES = {
  kinetic: "kinetic", elastic: "elastic", supplied: "gravity's work", lost: "lost",
};

/** The charts of one walk. `walks` are all that are shown: they share their ranges. */
export class LinkedCharts {
  constructor(walk, walks, pick) {
    Object.assign(this, { walk, width: 0 });
    this.charts = CHARTS.filter((each) => each.portrait || has(walk, each)).map((each) =>
      this.build(each, walks, pick),
    );
    this.element = html("div", { class: "charts" }, ...this.charts.map((each) => each.figure));
  }

  build(about, walks, pick) {
    const { walk } = this;
    const known = Object.keys(about.curves ?? {}).filter((name) => walk.channels[name]);
    const names = about.portrait ? [1, 2] : known;
    const curves = about.portrait
      ? names.map((leg) => portraitCurve(walk, leg))
      : names.map((name) => timeCurve(walk, name, about.curves[name]));
    const label = { xLabel: about.x ?? "time (s)", yLabel: about.y };
    const title = `${walk.name}: ${about.title}`;
    const chart = new Chart({ ...label, title, curves, pick: about.portrait ? null : pick });
    const like = (kind) => walks.flatMap((each) => kind(each)).filter(Boolean);
    const y = about.portrait
      ? rangeOf(like(({ channels }) => [channels.omega_1, channels.omega_2]))
      : cut(rangeOf(like(({ channels }) => names.map((name) => channels[name]))), about, walks);
    const angles = like(({ channels }) => [channels.theta_1, channels.theta_2]);
    const x = about.portrait && rangeOf(angles);
    const key = names.map((name, k) => keyEntry(curves[k].look, nameOf(walk, name)));
    const caption = html("figcaption", {}, about.title, html("span", { class: "key" }, ...key));
    const figure = html("figure", {}, caption, chart.element);
    return { about, names, chart, figure, x, y };
  }

  /** Draws everything for a width [px] and a span of time [s]. */
  show(width, span) {
    Object.assign(this, { width, span: span ?? null });
    for (const each of this.charts) each.chart.show(width, { x: each.x || this.window(), y: each.y });
  }

  window() {
    return this.span ?? [this.walk.start, this.walk.end];
  }

  mark(time) {
    const t = within(this.walk, time);
    const at = (name) => linear(this.walk, name, t);
    for (const { about, names, chart } of this.charts) {
      const points = about.portrait
        ? names.map((leg) => [at(`theta_${leg}`), at(`omega_${leg}`)])
        : names.map((name) => [t, at(name)]);
      chart.mark(about.portrait ? null : t, points);
    }
  }
}

function has(walk, about) {
  return Object.keys(about.curves).some((name) => walk.channels[name]);
}

/** A range without what a foot deep in the ground makes of it: 50 weights, a few leg lengths. */
function cut([low, high], about, walks) {
  if (!about.most) return [low, high];
  const most = Math.max(...walks.map(about.most));
  return [Math.max(low, -most), Math.min(high, most)];
}

function mostForce(walk) {
  return 50 * walk.weight;
}

function mostEnergy({ channels }) {
  const [low, high] = rangeOf([channels.kinetic, channels.supplied]);
  return 1.5 * Math.max(high, -low);
}

function timeCurve(walk, name, look) {
  return { x: walk.t, y: walk.channels[name], look, ordered: true };
}

function portraitCurve(walk, leg) {
  const [x, y] = [walk.channels[`theta_${leg}`], walk.channels[`omega_${leg}`]];
  return { x, y, look: `leg-${leg} whole` };
}

function nameOf(walk, name) {
  if (name === "lost" && walk.driven) return "lost less driven";
  return ENERGY_NAMES[name] ?? `leg ${String(name).slice(-1)}`;
}

function keyEntry(look, words) {
  return html("span", {}, html("span", { class: `sample ${look}`, "aria-hidden": "true" }), words);
}
