// Panels behind tabs.

import { h } from "./dom.js";

/** Panels of which one is shown, chosen by pointer or arrow keys. */
export function tabs(name, titles, changed) {
  const panel = {};
  const heads = {};
  const shell = { panel, shown: Object.keys(titles)[0] };
  const list = h("div", { class: "tabs", role: "tablist" });
  const root = h("section", { class: `panels ${name}` }, list);
  shell.root = root;
  shell.show = (key) => {
    shell.shown = key;
    for (const each of Object.keys(titles)) {
      panel[each].hidden = each !== key;
      heads[each].setAttribute("aria-selected", String(each === key));
      heads[each].tabIndex = each === key ? 0 : -1;
    }
    changed();
  };
  shell.enable = (key, there) => {
    heads[key].hidden = !there;
  };
  /** A mark beside a title, with a sentence; none where it is empty. */
  shell.mark = (key, sentence) => {
    heads[key].classList.toggle("marked", Boolean(sentence));
    heads[key].title = sentence;
  };
  for (const [key, title] of Object.entries(titles)) {
    panel[key] = h("div", { class: "panel", role: "tabpanel", "aria-label": title });
    heads[key] = h("button", { role: "tab", onclick: () => shell.show(key), onkeydown: (event) => {
      const way = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!way) return;
      const there = Object.keys(titles).filter((each) => !heads[each].hidden);
      const next = there[(there.indexOf(key) + way + there.length) % there.length];
      shell.show(next);
      heads[next].focus();
    } }, title);
    list.append(heads[key]);
    root.append(panel[key]);
  }
  for (const each of Object.keys(titles)) {
    panel[each].hidden = each !== shell.shown;
    heads[each].setAttribute("aria-selected", String(each === shell.shown));
  }
  return shell;
}
