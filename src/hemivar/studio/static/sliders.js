// A slider and a field for every number of the problem, under the table in which it stands.

import { h, shown } from "./dom.js";

const TITLES = { mesh: "Mesh", material: "Material", loads: "Loads", supports: "Supports", time: "Time", heat: "Heat" };
const AXES = ["x", "y", "z"];
const NAMED = { "lame.0": "λ", "lame.1": "μ", young: "Young's modulus", poisson: "Poisson's ratio" };

export class Sliders {
  /** edit(pairs, final) puts numbers into the text. */
  constructor(host, edit) {
    this.host = host;
    this.edit = edit;
    this.rows = new Map();
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
      this.value(one.key, value);
      this.edit([[one.key, one.whole ? Math.round(value) : value]], final);
    };
    slide.addEventListener("input", () => send(slide.value, false));
    slide.addEventListener("change", () => send(slide.value, true));
    field.addEventListener("change", () => send(field.value, true));
    const label = h("label", { for: id, title: one.meaning || one.key }, named(one.label));
    return { root: h("div", { class: "slider" }, label, slide, field, error), slide, field, error, low: range.low, high: range.high, step: range.step };
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
