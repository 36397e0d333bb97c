// Table of footsteps: the walk in numbers, for those who do not see it and those who want them.

import { fixed, html } from "./dom.js";

/** A table that opens, one row for each footstep; null where there is none. */
export function stepTable(walk) {
  const strikes = walk.footprints.filter((print) => print.strike);
  const rows = strikes.slice(1).map((print, k) => {
    const [period, length] = [print.t - strikes[k].t, print.x - strikes[k].x];
    const numbers = [print.t, period, length, length / period];
    const cells = numbers.map((value) => html("td", {}, fixed(value, 3)));
    const number = html("th", { scope: "row" }, String(k + 1));
    return html("tr", {}, number, html("td", {}, walk.skeleton.legs[print.leg - 1].label), ...cells);
  });
  if (!rows.length) return null;
  const heads = ["footstep", "strikes", "time (s)", "period (s)", "length (m)", "speed (m/s)"];
  const head = html("tr", {}, ...heads.map((words) => html("th", { scope: "col" }, words)));
  return html(
    "details",
    {},
    html("summary", {}, `Footsteps of ${walk.name}: ${rows.length}`),
    html("div", { class: "scrolls", tabindex: 0, role: "region", "aria-label": "Footsteps" },
      html("table", {}, html("thead", {}, head), html("tbody", {}, ...rows))),
  );
}
