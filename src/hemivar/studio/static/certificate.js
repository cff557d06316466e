// What is known of the picture: the badge in the head of the page, and the panel with the lines and the warnings.

import { h } from "./dom.js";

const SIGNS = { good: "✓ ", fair: "○ ", poor: "! ", none: "" };

export class CertificatePanel {
  /** show is called where the badge is pressed; mark(sentence) marks the tab of the panel. */
  constructor(host, show, mark) {
    this.mark = mark;
    this.badge = h("button", { class: "badge none", "aria-live": "polite", onclick: show }, "…");
    this.meaning = h("p", {});
    this.lines = h("pre", {});
    this.notices = h("ul", { class: "notices" });
    host.append(this.meaning, this.lines, this.notices);
  }

  set(level, title, meaning, lines) {
    this.badge.className = `badge ${level}`;
    this.badge.textContent = SIGNS[level] + title;
    this.badge.title = meaning;
    this.meaning.textContent = meaning;
    this.lines.textContent = lines.join("\n");
  }

  /** A state of a load path, of whose neighbours the path says whether they are stable. */
  onPath(stable) {
    const meaning = `From here to the next point of the path equilibria are ${stable ? "local minimisers" : "no minimisers"}.`;
    this.set(stable ? "fair" : "poor", `${stable ? "stable" : "unstable"} part of the path`, meaning, []);
  }

  note(text) {
    if ([...this.notices.children].some((one) => one.textContent === text)) return;
    this.notices.append(h("li", {}, text));
    const count = this.notices.children.length;
    this.mark(count === 1 ? "1 warning" : `${count} warnings`);
  }

  /** No warnings: those of the next problem follow. */
  clear() {
    this.notices.replaceChildren();
    this.mark("");
  }

  /** What is shown belongs to the picture before. */
  age() {
    this.badge.classList.add("stale");
  }
}
