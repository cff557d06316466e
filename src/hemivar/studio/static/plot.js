// Curves in the plane as an SVG: axes, lines, marks. The curves may turn back, as load paths do at folds.

import { s, shown, ticks } from "./dom.js";

const MARGIN = { left: 58, right: 14, top: 12, bottom: 36 };

export class Plot {
  /** A drawing in a host element; labels are those of the axes. */
  constructor(host, label) {
    this.host = host;
    this.root = s("svg", { class: "plot", role: "img", "aria-label": label });
    host.append(this.root);
    this.layer = s("g");
    this.observer = new ResizeObserver(() => this.last && this.draw(this.last));
    this.observer.observe(host);
  }

  /**
   * Draw { xlabel, ylabel, lines: [{x, y, class}], marks: [{x, y, class, title, form, colour}], bands: [{from, to}],
   * xrange, yrange, even }; ranges are those of the data where they are left out, with one scale for both axes where it is
   * even.
   */
  draw(given) {
    this.last = given;
    const width = this.host.clientWidth || 300;
    const height = this.host.clientHeight || 180;
    const inner = { w: Math.max(width - MARGIN.left - MARGIN.right, 20), h: Math.max(height - MARGIN.top - MARGIN.bottom, 20) };
    let [x0, x1] = range(given, "x", given.xrange);
    let [y0, y1] = range(given, "y", given.yrange);
    if (given.even) [[x0, x1], [y0, y1]] = even([x0, x1], [y0, y1], inner);
    this.toX = (x) => MARGIN.left + ((x - x0) / (x1 - x0)) * inner.w;
    this.toY = (y) => MARGIN.top + (1 - (y - y0) / (y1 - y0)) * inner.h;
    this.fromX = (px) => x0 + ((px - MARGIN.left) / inner.w) * (x1 - x0);
    this.fromY = (py) => y0 + (1 - (py - MARGIN.top) / inner.h) * (y1 - y0);
    const parts = [];
    for (const band of given.bands || []) {
      const from = this.toX(band.from);
      parts.push(s("rect", { class: "band", x: from, y: MARGIN.top, width: Math.max(this.toX(band.to) - from, 0), height: inner.h }));
    }
    for (const x of ticks(x0, x1, Math.max(inner.w / 70, 2))) {
      parts.push(s("line", { class: x === 0 ? "grid zero" : "grid", x1: this.toX(x), x2: this.toX(x), y1: MARGIN.top, y2: MARGIN.top + inner.h }));
      parts.push(s("text", { class: "tick", x: this.toX(x), y: MARGIN.top + inner.h + 14, "text-anchor": "middle" }, shown(x, 3)));
    }
    for (const y of ticks(y0, y1, Math.max(inner.h / 34, 2))) {
      parts.push(s("line", { class: y === 0 ? "grid zero" : "grid", x1: MARGIN.left, x2: MARGIN.left + inner.w, y1: this.toY(y), y2: this.toY(y) }));
      parts.push(s("text", { class: "tick", x: MARGIN.left - 5, y: this.toY(y) + 4, "text-anchor": "end" }, shown(y, 3)));
    }
    parts.push(s("text", { class: "label", x: MARGIN.left + inner.w / 2, y: height - 5, "text-anchor": "middle" }, given.xlabel));
    const middle = MARGIN.top + inner.h / 2;
    parts.push(s("text", { class: "label", x: 12, y: middle, "text-anchor": "middle", transform: `rotate(-90 12 ${middle})` }, given.ylabel));
    for (const line of given.lines || []) parts.push(s("path", { class: `line ${line.class || ""}`, d: this.path(line) }));
    for (const mark of given.marks || []) parts.push(this.mark(mark));
    this.root.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const active = this.root.getRootNode().activeElement;
    const held = this.layer.contains(active) ? active : null;
    this.root.replaceChildren(...parts, this.layer);
    held?.focus({ preventScroll: true }); // what leaves the page loses the focus
  }

  path(line) {
    let text = "";
    let pen = false;
    for (let k = 0; k < line.x.length; k += 1) {
      const good = Number.isFinite(line.x[k]) && Number.isFinite(line.y[k]);
      if (good) text += `${pen ? "L" : "M"}${this.toX(line.x[k]).toFixed(2)} ${this.toY(line.y[k]).toFixed(2)}`;
      pen = good;
    }
    return text;
  }

  mark(mark) {
    const found = drawnMark(mark.form || "disc", this.toX(mark.x), this.toY(mark.y), mark.size || 3.5, mark.colour);
    if (mark.class) found.setAttribute("class", mark.class);
    if (mark.title) found.append(s("title", {}, mark.title));
    return found;
  }

  /** Data coordinates of a pointer event. */
  at(event) {
    const box = this.root.getBoundingClientRect();
    return [this.fromX(event.clientX - box.left), this.fromY(event.clientY - box.top)];
  }
}

/** A mark of a form: disc, ring, square, triangle, cross. */
export function drawnMark(form, x, y, r, colour = "currentColor") {
  if (form === "ring") return s("circle", { cx: x, cy: y, r, fill: "none", stroke: colour, "stroke-width": 1.5 });
  if (form === "square") return s("rect", { x: x - r, y: y - r, width: 2 * r, height: 2 * r, fill: colour });
  if (form === "triangle") {
    return s("path", { d: `M${x - r} ${y + 0.8 * r}L${x + r} ${y + 0.8 * r}L${x} ${y - r}Z`, fill: colour });
  }
  if (form === "cross") {
    return s("path", { d: `M${x - r} ${y - r}L${x + r} ${y + r}M${x - r} ${y + r}L${x + r} ${y - r}`, stroke: colour, "stroke-width": 1.8 });
  }
  return s("circle", { cx: x, cy: y, r, fill: colour });
}

/** Ranges in which lengths along both axes look alike. */
function even([x0, x1], [y0, y1], inner) {
  const unit = Math.max((x1 - x0) / inner.w, (y1 - y0) / inner.h) / 2;
  const [x, y] = [(x0 + x1) / 2, (y0 + y1) / 2];
  return [[x - unit * inner.w, x + unit * inner.w], [y - unit * inner.h, y + unit * inner.h]];
}

function range(given, axis, wanted) {
  if (wanted) return wanted;
  let low = Infinity;
  let high = -Infinity;
  const take = (value) => {
    if (!Number.isFinite(value)) return;
    low = Math.min(low, value);
    high = Math.max(high, value);
  };
  for (const line of given.lines || []) for (const value of line[axis]) take(value);
  for (const mark of given.marks || []) take(mark[axis]);
  if (low > high) return [0, 1];
  const room = 0.06 * (high - low) || 0.1 * Math.abs(high) || 1;
  return [low - room, high + room];
}
