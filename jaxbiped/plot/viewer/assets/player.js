// Player: the clock of all walks, with its buttons, its slider and its keys.

import { fixed, html } from "./dom.js";

const SPEEDS = [0.001, 0.01, 0.1, 0.25, 0.5, 1, 2];
const STEP = 0.02;
/** How long a screen reader is left alone while time runs [ms]. */
const QUIET = 3000;
export const SPANS = [["whole walk", 0], ["1 s", 1], ["100 ms", 0.1], ["10 ms", 0.01]];
export const KEYS =
  "Space plays and pauses, arrow keys step, with Shift from heel strike to heel strike, " +
  "Home and End go to the ends, plus and minus change the speed.";

/** Calls `changed()` whenever time or what is shown changed; `describe()` says it in words. */
export class Player {
  constructor({ start, end, strikes, changed, describe }) {
    Object.assign(this, { start, end, strikes, changed, describe });
    Object.assign(this, { time: start, playing: false, speed: 1, follow: true, span: 0, told: 0 });
    this.play = html("button", { type: "button", class: "play", onclick: () => this.toggle() });
    this.slider = html("input", {
      type: "range", class: "time", min: start, max: end, step: "any", value: start,
      "aria-label": "Time", oninput: () => this.scrub(Number(this.slider.value)),
    });
    this.speeds = chosen("Speed", SPEEDS.map((each) => [`× ${each}`, each]), 1, (value) => {
      this.speed = value;
      this.say();
    });
    this.spans = chosen("Charts show", SPANS, 0, (value) => {
      this.span = value;
      this.changed();
    });
    this.followed = html("input", {
      type: "checkbox", checked: true, onchange: () => {
        this.follow = this.followed.checked;
        this.changed();
      },
    });
    this.live = html("p", { class: "hidden live", "aria-live": "polite", role: "status" });
    const follow = html("label", {}, this.followed, "Follow");
    this.element = html(
      "div",
      { class: "player", role: "group", "aria-label": "Player" },
      html("div", { class: "row" }, this.play, this.slider),
      html("div", { class: "row" }, this.speeds.label, follow, this.spans.label),
      this.live,
    );
    this.refresh();
  }

  toggle() {
    if (this.playing) return this.pause();
    if (this.time >= this.end) this.time = this.start;
    this.playing = true;
    this.last = null;
    this.refresh();
    requestAnimationFrame((now) => this.tick(now));
  }

  pause() {
    this.playing = false;
    this.refresh();
    this.changed();
    this.rest();
  }

  /** Time rests: that is told. */
  rest() {
    this.say();
    this.onrest?.(this.time);
  }

  /** Goes on where another player is, for other walks. */
  resume({ time, playing, speed, follow, span }) {
    Object.assign(this, { speed, follow, span });
    this.speeds.select.value = String(speed);
    this.spans.select.value = String(span);
    this.followed.checked = follow;
    this.scrub(time);
    if (playing) this.toggle();
  }

  tick(now) {
    if (!this.playing || !this.element.isConnected) return;
    const passed = this.last === null ? 0 : Math.min((now - this.last) / 1000, 0.1);
    this.last = now;
    this.time = Math.min(this.time + passed * this.speed, this.end);
    this.refresh();
    this.changed();
    if (this.time >= this.end) return this.pause();
    if (now - this.told > QUIET) this.say(now);
    requestAnimationFrame((next) => this.tick(next));
  }

  /** Goes to a time; a walk that plays is paused. */
  scrub(time) {
    this.playing = false;
    this.time = Math.min(Math.max(time, this.start), this.end);
    this.refresh();
    this.changed();
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => this.playing || this.rest(), 400);
  }

  refresh() {
    this.play.textContent = this.playing ? "Pause" : "Play";
    this.slider.value = this.time;
    const told = `${fixed(this.time, 2)} of ${fixed(this.end, 2)} seconds`;
    this.slider.setAttribute("aria-valuetext", told);
  }

  say(now = performance.now()) {
    this.told = now;
    const how = this.playing ? "playing" : "paused";
    this.live.textContent = `${fixed(this.time, 2)} s, ${how}, speed ${this.speed}. ${this.describe()}`;
  }

  changeSpeed(by) {
    const place = Math.min(Math.max(SPEEDS.indexOf(this.speed) + by, 0), SPEEDS.length - 1);
    this.speed = SPEEDS[place];
    this.speeds.select.value = String(this.speed);
    this.say();
  }

  /** The heel strike after or before the time, or an end. */
  nextStrike(forward) {
    const beyond = (each) => (forward ? each > this.time + 1e-9 : each < this.time - 1e-9);
    const found = this.strikes.filter(beyond);
    return forward ? (found[0] ?? this.end) : (found.at(-1) ?? this.start);
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const kind = event.target.tagName;
    const own = { BUTTON: [" "], INPUT: event.target.type === "checkbox" ? [" "] : [] };
    if (kind === "SELECT" || kind === "SUMMARY" || own[kind]?.includes(event.key)) return;
    const step = (sign) =>
      this.scrub(event.shiftKey ? this.nextStrike(sign > 0) : this.time + sign * STEP * this.speed);
    const actions = {
      " ": () => this.toggle(),
      ArrowRight: () => step(1),
      ArrowLeft: () => step(-1),
      ArrowUp: () => step(1),
      ArrowDown: () => step(-1),
      Home: () => this.scrub(this.start),
      End: () => this.scrub(this.end),
      "+": () => this.changeSpeed(1),
      "=": () => this.changeSpeed(1),
      "-": () => this.changeSpeed(-1),
    };
    if (!actions[event.key]) return;
    actions[event.key]();
    event.preventDefault();
    event.stopPropagation();
  }
}

/** A list to choose from, with its label. */
function chosen(name, entries, value, onchosen) {
  const options = entries.map(([words, each]) =>
    html("option", { value: each, selected: each === value }, words),
  );
  const select = html("select", { onchange: () => onchosen(Number(select.value)) }, ...options);
  return { select, label: html("label", {}, `${name} `, select) };
}
