// Page: shows the walks, the basin or the playground that it holds; keys work wherever nothing else has them.

import { Basin } from "./basin.js";
import { showPlayground } from "./playground.js";
import { showWalks } from "./view.js";

export function showPage() {
  const sent = JSON.parse(document.getElementById("walks").textContent);
  const main = document.querySelector("main");
  if (sent.playground) {
    showPlayground(sent, main);
    return;
  }
  if (sent.basin) {
    new Basin(sent, main);
    return;
  }
  const { player } = showWalks(sent, main, { autoplay: true });
  document.addEventListener("keydown", (event) => {
    if (event.target === document.body) player.key(event);
  });
}
