// Page: shows the walks that it holds; keys work wherever nothing else has them.

import { showWalks } from "./view.js";

export function showPage() {
  const sent = JSON.parse(document.getElementById("walks").textContent);
  const { player } = showWalks(sent, document.querySelector("main"), { autoplay: true });
  document.addEventListener("keydown", (event) => {
    if (event.target === document.body) player.key(event);
  });
}
