// Stage: a walker on its slope, with the forces on its feet and its footprints.

import { fixed, setAttributes, svg } from "./dom.js";
import { onPage, poseAt, strikesUntil } from "./pose.js";

const WIDTH = 480;
const HEIGHT = 300;
const TICK = 0.1;
/** Length of an arrow for the walker's weight, and of the longest, in heights of the walker. */
const PER_WEIGHT = 0.3;
const LONGEST = 1.1;

/** Draws one walk; `draw(time, follow)` moves it. */
export class Stage {
  constructor(walk) {
    this.walk = walk;
    this.size = walk.skeleton.height;
    this.tall = 1.2 * (this.size + walk.skeleton.above);
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
    const places = this.walk.channels[`${this.walk.skeleton.root}_x`];
    let [first, last] = [Infinity, -Infinity];
    for (const x of places) [first, last] = [Math.min(first, x), Math.max(last, x)];
    [this.first, this.last] = [first, last];
    const margin = 3 * this.size;
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
      const half = 0.06 * this.size;
      const depth = 0.035 * this.size;
      const [left, right] = [-half, half].map((x) => onPage(this.walk, print.x + x, -depth));
      const line = svg("line", {
        x1: left[0], y1: left[1], x2: right[0], y2: right[1],
        class: `footprint ${this.walk.skeleton.legs[print.leg - 1].look}`,
      });
      return { time: print.t, line };
    });
    this.world.append(svg("g", {}, ...this.prints.map((each) => each.line)));
  }

  drawWalker() {
    const { parts, feet } = this.walk.skeleton;
    const dot = (share, look) => svg("circle", { r: share * this.size, class: look, "data-part": look });
    this.limbs = parts.map(({ name, look }) =>
      svg("path", { class: `limb ${look}`, "data-part": `body-${name}` }),
    );
    this.feet = feet.map(({ look, radius }, k) => {
      const r = Math.max(radius, 0.012 * this.size);
      return svg("circle", { r, class: `foot ${look}`, "data-part": `foot-${k + 1}` });
    });
    this.arrows = feet.map(({ look }, k) =>
      svg("path", { class: `arrow ${look}`, "data-part": `force-${k + 1}` }),
    );
    this.centres = parts.map(() => dot(0.012, "centre"));
    this.hinges = parts.map(() => dot(0.02, "hinge"));
    this.root = dot(0.03, "root");
    const dots = [...this.centres, ...this.hinges, this.root];
    this.world.append(...this.limbs, ...this.feet, ...this.arrows, ...dots);
  }

  draw(time, follow) {
    const { walk } = this;
    const pose = poseAt(walk, time);
    const move = (circle, [cx, cy]) => setAttributes(circle, { cx, cy });
    pose.bodies.forEach(({ path, hinge, centre }, k) => {
      this.limbs[k].setAttribute("d", `M${path.map((point) => point.join(" ")).join("L")}`);
      move(this.hinges[k], hinge);
      move(this.centres[k], centre);
    });
    pose.feet.forEach((foot, k) => {
      move(this.feet[k], foot.centre);
      this.arrows[k].setAttribute("d", this.arrowPath(foot));
    });
    move(this.root, pose.root);
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
  arrowPath(foot) {
    const { walk } = this;
    const size = Math.hypot(foot.normal, foot.tangential);
    if (!(size > 1e-3 * walk.weight)) return "";
    const length = Math.min((PER_WEIGHT * size) / walk.weight, LONGEST) * this.size;
    const [ux, uz] = [foot.tangential / size, foot.normal / size];
    const head = Math.min(0.07 * this.size, 0.6 * length);
    const at = (along, across) =>
      onPage(walk, foot.place + along * ux - across * uz, along * uz + across * ux).join(" ");
    const neck = length - head;
    return (
      `M${at(0, 0)}L${at(neck, 0)}` +
      `M${at(neck, 0.45 * head)}L${at(length, 0)}L${at(neck, -0.45 * head)}Z`
    );
  }

  /** Along with the root point, or far enough to see the whole walk. */
  moveCamera(pose, follow) {
    const { walk } = this;
    if (follow) {
      const scale = Math.min(WIDTH / (2.4 * this.size), (0.87 * HEIGHT) / this.tall);
      const below = onPage(walk, pose.x, 0);
      this.place(scale, pose.root[0], below[1], 0.87 * HEIGHT);
      return;
    }
    const [left, right] = [this.first - this.size, this.last + this.size].map((x) => onPage(walk, x, 0));
    const drop = Math.abs(right[1] - left[1]);
    const scale = Math.min(WIDTH / (right[0] - left[0]), (0.9 * HEIGHT) / (drop + this.tall));
    const middle = 0.5 * (left[1] + right[1]);
    this.place(scale, 0.5 * (left[0] + right[0]), middle, 0.5 * HEIGHT + 0.42 * this.tall * scale);
  }

  place(scale, x, y, height) {
    const shift = `translate(${WIDTH / 2 - scale * x} ${height - scale * y})`;
    this.world.setAttribute("transform", `${shift} scale(${scale})`);
  }
}
