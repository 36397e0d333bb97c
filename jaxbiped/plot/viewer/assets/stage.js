// Stage: a walker on its slope, with the forces on its feet and its footprints.

import { fixed, setAttributes, svg } from "./dom.js";
import { onPage, poseAt, strikesUntil } from "./pose.js";

const WIDTH = 480;
const HEIGHT = 300;
const TICK = 0.1;
/** Length of an arrow for the walker's weight, and of the longest, in leg lengths. */
const PER_WEIGHT = 0.3;
const LONGEST = 1.1;

/** Draws one walk; `draw(time, follow)` moves it. */
export class Stage {
  constructor(walk) {
    this.walk = walk;
    this.world = svg("g");
    this.clock = svg("text", { x: 10, y: 22, class: "clock" });
    this.badge = svg("text", { x: 10, y: 42, class: "badge" });
    this.element = svg(
      "svg",
      { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: "stage", role: "img" },
      svg("title", {}, `${walk.name}: the walker on its slope`),
      this.world,
      this.clock,
      this.badge,
    );
    this.drawGround();
    this.drawFootprints();
    this.drawWalker();
  }

  drawGround() {
    const places = this.walk.channels.hip_x;
    let [first, last] = [Infinity, -Infinity];
    for (const x of places) [first, last] = [Math.min(first, x), Math.max(last, x)];
    [this.first, this.last] = [first, last];
    const margin = 3 * this.walk.l;
    const point = (x, z) => onPage(this.walk, x, z).map((v) => v.toFixed(5)).join(" ");
    let [path, ticks] = [`M${point(first - margin, 0)}L${point(last + margin, 0)}`, ""];
    for (let n = Math.ceil((first - margin) / TICK); n * TICK < last + margin; n++) {
      ticks += `M${point(n * TICK, 0)}L${point(n * TICK - 0.02, -0.02)}`;
    }
    this.world.append(
      svg("path", { d: path, class: "ground" }),
      svg("path", { d: ticks, class: "ground thin" }),
    );
  }

  drawFootprints() {
    this.prints = this.walk.footprints.map((print) => {
      const half = 0.06 * this.walk.l;
      const depth = 0.035 * this.walk.l;
      const [left, right] = [-half, half].map((x) => onPage(this.walk, print.x + x, -depth));
      const line = svg("line", {
        x1: left[0], y1: left[1], x2: right[0], y2: right[1],
        class: `footprint leg-${print.foot}`,
      });
      return { time: print.t, line };
    });
    this.world.append(svg("g", {}, ...this.prints.map((each) => each.line)));
  }

  drawWalker() {
    const radius = Math.max(this.walk.r, 0.012 * this.walk.l);
    this.legs = [1, 2].map((leg) => ({
      line: svg("line", { class: `limb leg-${leg}`, "data-part": `leg-${leg}` }),
      foot: svg("circle", { r: radius, class: `foot leg-${leg}`, "data-part": `foot-${leg}` }),
      arrow: svg("path", { class: `arrow leg-${leg}`, "data-part": `force-${leg}` }),
    }));
    this.hip = svg("circle", { r: 0.03 * this.walk.l, class: "hip", "data-part": "hip" });
    const parts = ["line", "foot", "arrow"].flatMap((part) => this.legs.map((leg) => leg[part]));
    this.world.append(...parts, this.hip);
  }

  draw(time, follow) {
    const { walk } = this;
    const pose = poseAt(walk, time);
    pose.legs.forEach((leg, k) => {
      const { line, foot, arrow } = this.legs[k];
      const [x, y] = leg.centre;
      setAttributes(line, { x1: pose.hip[0], y1: pose.hip[1], x2: x, y2: y });
      setAttributes(foot, { cx: x, cy: y });
      arrow.setAttribute("d", this.arrowPath(leg));
    });
    setAttributes(this.hip, { cx: pose.hip[0], cy: pose.hip[1] });
    for (const print of this.prints) {
      print.line.style.display = print.time <= pose.t ? "" : "none";
    }
    this.moveCamera(pose, follow);
    this.clock.textContent = `${fixed(pose.t, 3)} s, heel strikes: ${strikesUntil(walk, pose.t)}`;
    this.badge.textContent = pose.ended ? walk.ending : "";
    this.element.dataset.time = pose.t;
    return pose;
  }

  /** An arrow from the point of contact, as long as the force is large. */
  arrowPath(leg) {
    const { walk } = this;
    const size = Math.hypot(leg.normal, leg.tangential);
    if (!(size > 1e-3 * walk.weight)) return "";
    const length = Math.min((PER_WEIGHT * size) / walk.weight, LONGEST) * walk.l;
    const [ux, uz] = [leg.tangential / size, leg.normal / size];
    const head = Math.min(0.07 * walk.l, 0.6 * length);
    const at = (along, across) =>
      onPage(walk, leg.place + along * ux - across * uz, along * uz + across * ux).join(" ");
    const neck = length - head;
    return (
      `M${at(0, 0)}L${at(neck, 0)}` +
      `M${at(neck, 0.45 * head)}L${at(length, 0)}L${at(neck, -0.45 * head)}Z`
    );
  }

  /** Along with the hip, or far enough to see the whole walk. */
  moveCamera(pose, follow) {
    const { walk } = this;
    if (follow) {
      const scale = WIDTH / (2.4 * walk.l);
      const below = onPage(walk, pose.x, 0);
      this.place(scale, pose.hip[0], below[1], 0.87 * HEIGHT);
      return;
    }
    const [left, right] = [this.first - walk.l, this.last + walk.l].map((x) => onPage(walk, x, 0));
    const drop = Math.abs(right[1] - left[1]);
    const scale = Math.min(WIDTH / (right[0] - left[0]), (0.9 * HEIGHT) / (drop + 1.2 * walk.l));
    const middle = 0.5 * (left[1] + right[1]);
    this.place(scale, 0.5 * (left[0] + right[0]), middle, 0.5 * HEIGHT + 0.5 * walk.l * scale);
  }

  place(scale, x, y, height) {
    const shift = `translate(${WIDTH / 2 - scale * x} ${height - scale * y})`;
    this.world.setAttribute("transform", `${shift} scale(${scale})`);
  }
}
