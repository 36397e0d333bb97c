// Page: shows the walks or the basin that it holds; keys work wherever nothing else has them.

import { Basin } from "./basin.js";
import { showWalks } from "./view.js";

export function showPage() {
  const sent = JSON.parse(document.getElementById("walks").textContent);
  const main = document.querySelector("main");
  if (sent.basin) {
    new Basin(sent, main);
    return;
  }
  const { player } = showWalks(sent, main, { autoplay: true });
  document.addEventListener("keydown", (event) => {
    if (event.target === document.body) player.key(event);
  });
}
