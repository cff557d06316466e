// The factor by which displacements are drawn: found by their size until it is moved by hand.

import { h, shown } from "./dom.js";

/** Part of the size of a body that its largest displacement takes. */
const VISIBLE = 0.08;

export class Deformation {
  /** changed is called when the factor was moved by hand; again when it shall be found anew. */
  constructor(changed, again) {
    this.kept = false; // chosen by hand, or by a link
    this.slide = h("input", { type: "range", min: 0, max: 4, step: 0.05, value: 0, "aria-label": "deformation scale", oninput: () => {
      this.kept = true;
      this.tell();
      changed();
    } });
    this.told = h("output", {}, "×1");
    this.auto = h("button", { title: "Choose the factor of the deformation by its size", onclick: () => {
      this.kept = false;
      again();
    } }, "auto");
    this.label = h("label", {}, "deformation ", this.slide, this.told);
  }

  get factor() {
    return 10 ** Number(this.slide.value);
  }

  set(factor) {
    this.slide.max = Math.max(2, Math.ceil(Math.log10(factor) + 1));
    this.slide.value = Math.log10(factor);
    this.tell();
  }

  /** Make the largest of the displacements of a body of a size visible. */
  fit(all, size) {
    const largest = all.reduce((most, { displacement }) => displacement.reduce((a, b) => Math.max(a, Math.abs(b)), most), 0);
    const wanted = (VISIBLE * size) / (largest || VISIBLE * size);
    this.set(wanted > 1 ? Math.min(wanted, 1e4) : 1);
  }

  tell() {
    this.told.textContent = `×${shown(this.factor, 2)}`;
  }
}
