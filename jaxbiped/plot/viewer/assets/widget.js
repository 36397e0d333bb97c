// Widget: the same view in a notebook, its walks and its time shared with Python.

import { showWalks } from "./view.js";

export function render({ model, el }) {
  let shown = null;
  const show = () => {
    const before = shown?.player;
    shown?.stop();
    shown = showWalks(model.get("sent"), el, { playerFirst: true });
    if (before) shown.player.resume(before);
    else shown.player.scrub(model.get("time"));
    shown.player.onrest = (time) => {
      model.set("time", time);
      model.save_changes();
    };
  };
  const go = () => {
    if (model.get("time") !== shown.player.time) shown.player.scrub(model.get("time"));
  };
  show();
  model.on("change:sent", show);
  model.on("change:time", go);
  return () => {
    shown.stop();
    model.off("change:sent", show);
    model.off("change:time", go);
  };
}
