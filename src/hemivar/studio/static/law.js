// Contact laws as curves, the contact points of the picture on them, and handles where the law is a table of numbers.

import { h, s, shown, withUnit } from "./dom.js";
import { Plot } from "./plot.js";

/** Lists of a law that are the points of its curve: [places, values], and what multiplies the values. */
const TABLES = [["penetrations", "pressures", null], ["slips", "values", "bound"]];

export class LawView {
  /** edit(pairs, final) puts numbers into the text: pairs of key and value. */
  constructor(host, edit) {
    this.host = host;
    this.edit = edit;
    this.panels = new Map();
  }

  /** curves as law_curves.py makes them; numbers is a map from keys to values of the text. */
  setCurves(curves, numbers, units) {
    this.curves = curves;
    this.units = units;
    const wanted = new Set();
    for (const curve of curves) {
      const name = `${curve.boundary} ${curve.side}`;
      wanted.add(name);
      if (!this.panels.has(name)) this.panels.set(name, this.panel(name));
      const panel = this.panels.get(name);
      panel.curve = curve;
      panel.heading.textContent = `${curve.boundary}: ${curve.name} ${curve.side === "normal" ? "(normal)" : "(friction)"}`;
      panel.note.textContent = curve.note;
      panel.lines.textContent = curve.lines.join("\n");
      if (!panel.dragging) panel.handles = handlesOf(curve, numbers);
      panel.hint.hidden = !panel.handles.length;
    }
    for (const [name, panel] of this.panels) {
      if (wanted.has(name)) continue;
      panel.root.remove();
      this.panels.delete(name);
    }
    this.draw();
  }

  panel(name) {
    const heading = h("h3");
    const note = h("span", { class: "quiet" });
    const place = h("div", { class: "lawplot" });
    const lines = h("pre");
    const hint = h("p", { class: "quiet" }, "Drag the points, or focus one and use the arrow keys.");
    const root = h("section", { class: "lawpanel" }, heading, note, place, hint, h("details", {}, h("summary", {}, "constants"), lines));
    this.host.append(root);
    return { root, heading, note, lines, hint, plot: new Plot(place, `law ${name}`), handles: [] };
  }

  draw() {
    for (const panel of this.panels.values()) {
      const { curve } = panel;
      if (!curve) continue;
      const lines = curve.pieces.map(([x, y]) => ({ x, y, class: "law" }));
      if (panel.handles.length) lines.splice(0, lines.length, tableLine(panel.handles, curve));
      const finite = [...curve.pieces.flatMap((piece) => piece[1]), ...panel.handles.map((one) => one.y)].map(Math.abs);
      const [place, force] = curve.points;
      const marks = place.map((x, k) => ({ x, y: force[k], class: "onlaw", size: 2.6 }));
      for (const mark of marks) finite.push(Math.abs(mark.y));
      const most = 1.15 * Math.max(...finite, 1e-300);
      const low = Math.min(0, ...curve.pieces.flatMap((piece) => piece[1]), ...panel.handles.map((one) => one.y), ...marks.map((m) => m.y));
      for (const [place, left, right] of panel.handles.length ? [] : curve.jumps) {
        const y = [left === null ? -most : left, right === null ? most : right];
        lines.push({ x: [place, place], y, class: y[1] < y[0] ? "law falls" : "law" });
      }
      const reach = panel.handles.reduce((a, one) => Math.max(a, 1.1 * Math.abs(one.x)), curve.reach);
      const side = curve.side === "normal" ? ["penetration", "pressure"] : [curve.by === "rate" ? "slip rate" : "slip", curve.bounded ? "traction over its bound" : "traction"];
      const across = curve.by !== "rate" || !this.units.time ? this.units.length : `${this.units.length}/${this.units.time}`;
      panel.plot.draw({
        xlabel: withUnit(side[0], across), ylabel: curve.bounded ? side[1] : withUnit(side[1], this.units.stress), lines, marks,
        xrange: [-reach, reach], yrange: [low < 0 ? -most : -0.08 * most, most],
      });
      const { layer } = panel.plot;
      const focused = [...layer.children].indexOf(layer.getRootNode().activeElement);
      layer.replaceChildren(...panel.handles.map((one, k) => this.handle(panel, one, k)));
      layer.children[focused]?.focus({ preventScroll: true });
    }
  }

  handle(panel, one, k) {
    const node = s("circle", {
      class: "handle", cx: panel.plot.toX(one.x), cy: panel.plot.toY(one.y), r: 6.5, tabindex: "0", role: "slider",
      "aria-label": `point ${k + 1}`, "aria-valuetext": `${shown(one.x)}, ${shown(one.y)}`, "data-point": k,
    });
    const put = (x, y, final) => {
      const before = panel.handles[k - 1];
      const after = panel.handles[k + 1];
      one.x = round(Math.min(Math.max(x, before ? before.x : one.least), after ? after.x : Infinity));
      one.y = round(one.least === 0 ? Math.max(y, 0) : y);
      this.draw();
      this.edit([[one.keys[0], one.x], [one.keys[1], round(one.y / one.factor)]], final);
    };
    node.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      panel.dragging = true;
      const follow = (e) => put(...panel.plot.at(e), false);
      const end = (e) => {
        window.removeEventListener("pointermove", follow);
        window.removeEventListener("pointerup", end);
        panel.dragging = false;
        put(...panel.plot.at(e), true);
      };
      window.addEventListener("pointermove", follow);
      window.addEventListener("pointerup", end);
    });
    node.addEventListener("keydown", (event) => {
      const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      if (!way) return;
      event.preventDefault();
      const { plot } = panel;
      put(one.x + 4 * way[0] * (plot.fromX(1) - plot.fromX(0)), one.y + 4 * way[1] * (plot.fromY(0) - plot.fromY(1)), true);
    });
    return node;
  }
}

/** The points of a law whose table stands in the text. */
function handlesOf(curve, numbers) {
  const stem = `contact.${curve.boundary}.${curve.side}`;
  for (const [places, values, by] of TABLES) {
    const factor = by ? numbers.get(`${stem}.${by}`) : 1;
    const found = [];
    for (let k = 0; numbers.has(`${stem}.${places}.${k}`) && numbers.has(`${stem}.${values}.${k}`); k += 1) {
      const keys = [`${stem}.${places}.${k}`, `${stem}.${values}.${k}`];
      found.push({ keys, factor, x: numbers.get(keys[0]), y: factor * numbers.get(keys[1]), least: curve.side === "friction" ? 0 : -Infinity });
    }
    if (found.length && factor > 0) return found;
  }
  return [];
}

/** The table itself with its constant ends: it follows a drag at once. */
function tableLine(handles, curve) {
  const [first, last] = [handles[0], handles[handles.length - 1]];
  const x = [...handles.map((one) => one.x), Math.max(curve.reach, last.x)];
  const y = [...handles.map((one) => one.y), last.y];
  if (curve.side === "friction") return { x: [...x.map((v) => -v).reverse(), ...x], y: [...y.map((v) => -v).reverse(), ...y], class: "law" };
  return { x: [Math.min(-curve.reach, first.x), ...x], y: [first.y, ...y], class: "law" };
}

function round(value) {
  return Number(value.toPrecision(5));
}
