// A slider and a field for every number of the problem, under the table in which it stands.

import { h, shown, withUnit } from "./dom.js";

const [PLAY, PAUSE] = ["\u25b6", "\u23f8"];
/** Pictures from one end of a slider that plays to the other, and the least time between two of them. */
const [FRAMES, PAUSE_MS] = [60, 40];

const TITLES = { mesh: "Mesh", material: "Material", loads: "Loads", supports: "Supports", time: "Time", heat: "Heat" };
const AXES = ["x", "y", "z"];
const NAMED = {
  "lame.0": "Lamé's λ", "lame.1": "Lamé's μ", young: "Young's modulus", poisson: "Poisson's ratio", "body.0": "body force x", "body.1": "body force y",
  "body.2": "body force z", "rectangle.0": "width", "rectangle.1": "height", order: "order of the elements", refine: "refinements",
};

export class Sliders {
  /** edit(pairs, final) puts numbers into the text. */
  constructor(host, edit) {
    this.host = host;
    this.edit = edit;
    this.rows = new Map();
    this.last = ""; // the key that was moved last
  }

  /** The sliders that sliders.py states; rows of the same numbers stay, with the range that they had. */
  set(sliders) {
    const keys = sliders.map((one) => one.key).join("\n");
    if (keys !== this.keys) {
      this.build(sliders);
      this.keys = keys;
    }
    for (const one of sliders) this.value(one.key, one.value);
  }

  build(sliders) {
    const before = this.rows;
    this.rows = new Map();
    const groups = new Map();
    const open = new Map([...this.host.querySelectorAll("details")].map((one) => [one.dataset.table, one.open]));
    for (const one of sliders) {
      const known = before.get(one.key);
      const row = this.row(one, known && one.value >= known.low && one.value <= known.high ? known : one);
      this.rows.set(one.key, row);
      if (!groups.has(one.table)) groups.set(one.table, []);
      groups.get(one.table).push(row.root);
    }
    const rank = (table) => ["contact", "loads", "material", "supports", "mesh"].findIndex((name) => table.startsWith(name)) & 7;
    const order = [...groups.keys()].sort((a, b) => rank(a) - rank(b));
    this.host.replaceChildren(...order.map((table) => h("details", {
      "data-table": table, open: open.has(table) ? open.get(table) : table !== "mesh",
    }, h("summary", {}, TITLES[table] || table.replace("contact.", "Contact: ")), ...groups.get(table))));
  }

  row(one, range) {
    const id = `s-${one.key}`;
    const slide = h("input", { type: "range", id, min: String(range.low), max: String(range.high), step: String(range.step), "data-key": one.key });
    const field = h("input", { type: "number", step: "any", "aria-label": one.key });
    const error = h("p", { class: "error", hidden: true, id: `${id}-error` });
    const send = (text, final) => {
      const value = Number(text);
      if (text === "" || !Number.isFinite(value)) return;
      this.last = one.key;
      this.value(one.key, value);
      this.edit([[one.key, one.whole ? Math.round(value) : value]], final);
    };
    const byHand = (text, final) => {
      this.stop();
      send(text, final);
    };
    slide.addEventListener("input", () => byHand(slide.value, false));
    slide.addEventListener("change", () => byHand(slide.value, true));
    field.addEventListener("change", () => byHand(field.value, true));
    const name = withUnit(named(one.label), one.unit);
    const label = h("label", { for: id, title: one.meaning || one.key }, name);
    const play = h("button", { class: "play", title: "Move this slider to and fro", "aria-label": `play ${name}`, onclick: () => this.play(one.key) }, PLAY);
    const root = h("div", { class: "slider" }, label, play, slide, field, error);
    return { root, slide, field, error, play, send, name, whole: one.whole, low: range.low, high: range.high, step: range.step };
  }

  /** Let a slider move by itself, or stop it. */
  play(key) {
    const playing = this.playing && this.playing.key === key;
    this.stop();
    if (playing) return;
    this.playing = { key, way: 1, since: 0 };
    this.rows.get(key).play.textContent = PAUSE;
    this.tick();
  }

  stop() {
    if (!this.playing) return;
    const { key, timer } = this.playing;
    clearTimeout(timer);
    this.playing = null;
    const row = this.rows.get(key);
    if (!row) return;
    row.play.textContent = PLAY;
    row.send(row.slide.value, true);
  }

  /** The next value of the slider that plays: a moment after the picture of the last one is there. */
  tick() {
    if (!this.playing) return;
    const { playing } = this;
    const row = this.rows.get(playing.key);
    clearTimeout(playing.timer);
    if (!row) {
      this.playing = null;
      return;
    }
    playing.timer = setTimeout(() => {
      const now = Number(row.slide.value);
      if (now >= row.high) playing.way = -1;
      if (now <= row.low) playing.way = 1;
      const step = (row.high - row.low) / FRAMES;
      const next = Math.min(Math.max(now + playing.way * (row.whole ? Math.max(1, Math.round(step)) : step), row.low), row.high);
      row.slide.value = String(next);
      row.send(String(next), false);
    }, Math.max(0, playing.since + PAUSE_MS - performance.now()));
    playing.since = performance.now();
  }

  /** Whether sliders have a play button: an evolution in time plays by its own bar. */
  playable(there) {
    this.host.classList.toggle("timed", !there);
    if (!there) this.stop();
  }

  /** Keys and names of the sliders, and the range of one of them. */
  get names() {
    return [...this.rows].map(([key, row]) => [key, row.name]);
  }

  range(key) {
    const row = this.rows.get(key);
    return row ? [row.low, row.high] : [0, 1];
  }

  /** Show a value; the slider grows where it lies beyond its end. */
  value(key, value) {
    const row = this.rows.get(key);
    if (!row) return;
    if (value < row.low) row.slide.min = String((row.low = value));
    if (value > row.high) row.slide.max = String((row.high = value));
    if (document.activeElement !== row.slide || Number(row.slide.value) !== value) row.slide.value = String(value);
    if (document.activeElement !== row.field || Number(row.field.value) !== value) row.field.value = short(value);
    row.slide.setAttribute("aria-valuetext", shown(value));
  }

  /** A sentence beside the field that it speaks of; whether there is such a field. */
  error(key, sentence) {
    for (const [name, row] of this.rows) {
      const here = name === key;
      row.error.hidden = !here;
      row.error.textContent = here ? sentence : "";
      row.root.classList.toggle("wrong", here);
      if (here) {
        row.slide.setAttribute("aria-describedby", row.error.id);
        const group = row.root.closest("details");
        if (group) group.open = true;
      }
    }
    return this.rows.has(key);
  }
}

/** A number in few characters: 6e7 rather than 60000000. */
function short(value) {
  const [plain, power] = [String(value), value.toExponential().replace("e+", "e")];
  return power.length < plain.length ? power : plain;
}

/** ``top.displacement.1`` as people read it. */
function named(label) {
  if (NAMED[label]) return NAMED[label];
  const steps = label.split(".");
  const last = steps[steps.length - 1];
  const vector = /^(body|rectangle|box|cells|displacement|normal|point|centre|axis|top|bottom|left|right|front|back)$/;
  if (/^\d+$/.test(last) && steps.length > 1 && vector.test(steps[steps.length - 2])) steps[steps.length - 1] = AXES[Number(last)] || last;
  return steps.join(" ").replaceAll("_", " ");
}
