// The state of a studio as the part of an address behind #, so that a link restores it.

import { MAP_NAMES } from "./colours.js";
import { packed } from "./text.js";

/** Colourings of the body by their names. */
export const COLOURS = { displacement: "displacement", stress: "von Mises stress", penetration: "penetration", none: "no colour" };

const VIEW = ["yaw", "pitch", "zoom", "x", "y"];

/** Text, view and choices of a studio. */
export async function addressOf(studio) {
  const state = new URLSearchParams();
  if (studio.problem.text !== studio.start) state.set("p", await packed(studio.problem.text));
  state.set("v", VIEW.map((name) => Number(studio.body.view[name].toFixed(3))).join(","));
  state.set("c", [studio.colour.value, studio.map.value, studio.lower.shown, studio.side.shown, studio.root.dataset.theme].join(","));
  if (studio.shape) state.set("s", studio.deformation.slide.value);
  return state.toString();
}

/** Put view and choices of an address into a studio; what makes no sense is left out. */
export function restore(studio, kept) {
  const numbers = (kept.get("v") || "").split(",").map(Number);
  if (numbers.length === VIEW.length && numbers.every(Number.isFinite)) {
    studio.body.first = Object.fromEntries(VIEW.map((name, k) => [name, numbers[k]]));
  }
  const [colour, map, lower, side, theme] = (kept.get("c") || "").split(",");
  if (colour in COLOURS) studio.colour.value = colour;
  if (MAP_NAMES.includes(map)) studio.map.value = studio.body.options.map = map;
  if (lower in studio.lower.panel) studio.lower.show(lower);
  if (side in studio.side.panel) studio.side.show(side);
  if (["light", "dark"].includes(theme)) studio.setTheme(theme);
  const scale = Number(kept.get("s"));
  if (kept.has("s") && Number.isFinite(scale)) {
    studio.deformation.kept = true;
    studio.deformation.set(10 ** Math.min(Math.max(scale, 0), 8));
  }
}
