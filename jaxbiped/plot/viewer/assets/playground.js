// Playground: sliders that simulate, and the walk that they lead to.

import { html } from "./dom.js";
import { makeSimulator } from "./simulator.js";
import { setColours, showWalks } from "./view.js";

/** Fills an element with sliders and their walk; resolves when the first one is shown. */
export async function showPlayground(sent, el) {
  const simulator = await makeSimulator(sent.playground);
  const inputs = [...sent.playground.inputs];
  const told = html("p", { class: "note", role: "status" });
  const place = html("div");
  let shown = null;
  const show = () => {
    const began = performance.now();
    const walk = simulator.run(inputs, slopeOf(sent.playground, inputs));
    const took = performance.now() - began;
    const before = shown?.player;
    const playing = before?.playing ?? true;
    shown?.stop();
    if (!walk) {
      place.replaceChildren(html("p", {}, "No walk starts like this."));
      [shown, told.textContent] = [null, ""];
      return;
    }
    shown = showWalks({ walks: [walk], colours: sent.colours }, place, { autoplay: !before });
    if (before) shown.player.resume({ ...settings(before), playing });
    el.dataset.took = took;
    told.textContent = `${walk.t.length} steps, simulated in ${took.toFixed(0)} ms in this page.`;
  };
  const moved = sent.playground.sliders.map((slider) => row(slider, inputs, later(show)));
  const controls = { class: "sliders", role: "group", "aria-label": "Parameters and start" };
  const view = html("div", { class: "jaxbiped-view" }, html("div", controls, ...moved), told);
  setColours(view, sent.colours);
  el.replaceChildren(view, place);
  show();
  const keys = (event) => event.target === document.body && shown?.player.key(event);
  document.addEventListener("keydown", keys);
}

/** The slope is drawn, too. */
function slopeOf({ sliders }, inputs) {
  return inputs[sliders.find((each) => each.leaf.endsWith("slope")).input];
}

/** A walk that had ended begins anew. */
function settings({ time, end, start, speed, follow, span }) {
  return { time: time >= end ? start : time, speed, follow, span };
}

function row(slider, inputs, changed) {
  const reading = html("output", {});
  const tell = () => {
    const text = inputs[slider.input].toPrecision(3).replace("-", "−");
    reading.textContent = `${text} ${slider.unit}`;
    range?.setAttribute("aria-valuetext", reading.textContent);
  };
  let range = null;
  range = html("input", {
    type: "range", class: "time", min: slider.least, max: slider.most, step: "any",
    value: slider.value, "data-leaf": slider.leaf, oninput: () => {
      const value = Number(range.value);
      inputs[slider.input] = slider.power ? 10 ** value : value;
      tell();
      changed();
    },
  });
  tell();
  return html("label", {}, html("span", {}, slider.words), range, reading);
}

/** A call of many is made once, before the next picture. */
function later(call) {
  let due = false;
  return () => {
    if (due) return;
    due = true;
    requestAnimationFrame(() => {
      due = false;
      call();
    });
  };
}
