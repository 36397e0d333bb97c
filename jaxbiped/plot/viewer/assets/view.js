// View: walks side by side under one clock. What a page and a notebook show.

import { decodeWalk } from "./channels.js";
import { fixed, html } from "./dom.js";
import { LinkedCharts } from "./linked_charts.js";
import { KEYS, Player } from "./player.js";
import { strikesUntil } from "./pose.js";
import { Stage } from "./stage.js";
import { stepTable } from "./step_table.js";

/**
 * Shows walks in an element; returns what moves them. `autoplay` starts them at once;
 * `playerFirst` puts the player above them, where no window holds it at its lower edge.
 */
export function showWalks(sent, el, { autoplay = false, playerFirst = false } = {}) {
  const walks = sent.walks.map(decodeWalk);
  const root = html("div", { class: "jaxbiped-view", role: "region", "aria-label": "Walks" });
  setColours(root, sent.colours);
  const player = new Player({
    start: Math.min(...walks.map((walk) => walk.start)),
    end: Math.max(...walks.map((walk) => walk.end)),
    strikes: strikeTimes(walks),
    changed: () => draw(),
    describe: () => walks.map((walk) => sentence(walk, player.time)).join(" "),
  });
  const panels = walks.map((walk) => panel(walk, walks, (time) => player.scrub(time)));
  const keys = html("p", { class: "keys" }, KEYS);
  const all = { class: walks.length === 1 ? "panels single" : "panels" };
  const shown = html("div", all, ...panels.map((each) => each.element));
  root.append(...(playerFirst ? [player.element, shown] : [shown, player.element]), keys);
  root.addEventListener("keydown", (event) => player.key(event));
  const draw = () => {
    for (const each of panels) {
      const pose = each.stage.draw(player.time, player.follow);
      each.reading.textContent = reading(each.walk, pose);
      showCharts(each, player);
    }
    root.dataset.time = player.time;
  };
  el.replaceChildren(root);
  const resized = new ResizeObserver(() => draw());
  for (const { element, charts } of panels) {
    for (const each of [element, ...charts.charts.map(({ figure }) => figure)]) resized.observe(each);
  }
  draw();
  player.say();
  if (autoplay && !matchMedia("(prefers-reduced-motion: reduce)").matches) player.toggle();
  const stop = () => {
    player.playing = false;
    resized.disconnect();
  };
  return { player, walks, stop };
}

/** Moves the cursor of a panel's charts; draws them anew only where what they show has changed. */
function showCharts({ charts, element, walk }, { time, span }) {
  const sizes = charts.sizes();
  const wanted = JSON.stringify([sizes, span && time, span]);
  if (element.dataset.drawn !== wanted) charts.show(sizes, span ? around(walk, time, span) : null);
  element.dataset.drawn = wanted;
  charts.mark(time);
}

function panel(walk, walks, pick) {
  const [stage, charts] = [new Stage(walk), new LinkedCharts(walk, walks, pick)];
  const slope = `slope ${fixed(walk.slope, 4)} rad`;
  const told = `Outcome after ${fixed(walk.end, 2)} s: ${walk.ending}; ${slope}`;
  const reading = html("p", { class: "reading" });
  const note = html("p", { class: "note" }, marksNote(walk));
  const element = html(
    "section",
    { class: "panel", "aria-label": walk.name },
    html("h2", {}, walk.name),
    html("p", { class: "told" }, told),
    html("div", { class: "picture" }, stage.element, reading, note),
    charts.element,
  );
  const table = stepTable(walk);
  if (table) element.append(table);
  return { walk, stage, charts, reading, element };
}

/** What a pose reads: angles body by body, forces foot by foot. */
function reading(walk, { bodies, feet }) {
  const { parts, feet: soles } = walk.skeleton;
  const angles = bodies.map(({ angle }, k) => `${parts[k].label}: ${fixed(angle, 3)} rad`);
  const told = `${angles.join("; ")} (angle)`;
  if (!tellsForces(walk)) return told;
  const forces = feet.map(
    ({ normal, tangential }, k) => `${soles[k].label}: ${fixed(normal, 1)} N, ${fixed(tangential, 1)} N`,
  );
  return `${told}; ${forces.join("; ")} (normal and tangential force)`;
}

function tellsForces(walk) {
  return walk.channels.normal_1 !== undefined;
}

function marksNote(walk) {
  const marks = "Marks under the slope: footprints; ticks: every 0.1 m.";
  if (!tellsForces(walk)) return marks;
  return (
    "Arrows: forces of the ground on the feet. A force equal to the walker's weight, " +
    `${fixed(walk.weight, 1)} N, is 0.3 walker heights long; none is longer than 1.1 heights. ${marks}`
  );
}

/** A span of time around a moment, as far as there is a walk. */
function around(walk, time, span) {
  const length = Math.min(span, walk.end - walk.start);
  const first = Math.min(Math.max(time - length / 2, walk.start), walk.end - length);
  return [first, first + length];
}

function strikeTimes(walks) {
  const times = walks.flatMap((walk) => walk.footprints.filter((p) => p.strike).map((p) => p.t));
  return times.sort((a, b) => a - b);
}

function sentence(walk, time) {
  const told = time >= walk.end ? walk.ending : `heel strikes: ${strikesUntil(walk, time)}`;
  return `${walk.name}: ${told}.`;
}

export function setColours(root, colours) {
  for (const [name, value] of Object.entries(colours)) root.style.setProperty(`--${name}`, value);
}
