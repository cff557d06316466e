// The contact boundary, the load path with its cursor, all solutions side by side, and the play bar.

import { stateMark } from "./colours.js";
import { h, s, shown } from "./dom.js";
import { withUnit } from "./law.js";
import { drawnMark, Plot } from "./plot.js";

/** Pressure and friction, or penetration and slip, along a contact boundary, with the states below. */
export class ContactChart {
  constructor(host) {
    this.boundary = h("select", { "aria-label": "contact boundary", onchange: () => this.draw() });
    this.what = h("select", { "aria-label": "what is drawn", onchange: () => this.draw() },
      h("option", { value: "forces" }, "pressure and friction"), h("option", { value: "moves" }, "penetration and slip"));
    this.legend = h("span", { class: "legend" });
    const place = h("div", { class: "fill" });
    host.append(h("div", { class: "bar" }, this.boundary, this.what, this.legend), place);
    this.plot = new Plot(place, "contact boundary");
  }

  set(shape, fields, units) {
    if (this.shape !== shape) {
      this.boundary.replaceChildren(...shape.boundaries.map((one) => h("option", {}, one.name)));
      this.boundary.hidden = shape.boundaries.length < 2;
    }
    [this.shape, this.fields, this.units] = [shape, fields, units];
    this.draw();
  }

  draw() {
    const one = this.shape && this.shape.boundaries[Math.max(this.boundary.selectedIndex, 0)];
    if (!one || !this.fields || !this.fields.local) {
      this.plot.draw({ xlabel: "", ylabel: "no contact boundary", lines: [] });
      return;
    }
    const { local, pressure, friction, state } = this.fields;
    const c = local.columns;
    const order = one.index.map((j, k) => [one.along[k], j]).sort((a, b) => a[0] - b[0]);
    const x = order.map((pair) => pair[0]);
    const of = (value) => order.map((pair) => value(pair[1]));
    const slip = (j) => (c === 3 ? Math.hypot(local[3 * j + 1], local[3 * j + 2]) : local[c * j + 1]);
    const forces = this.what.value === "forces";
    const series = forces
      ? [["pressure", of((j) => pressure[j])], ["friction", of((j) => friction[j])]]
      : [["penetration", of((j) => local[c * j])], ["slip", of(slip)]];
    if (c === 1) series.pop();
    const flat = this.shape.kind === "plane";
    const names = ["first", "second"];
    const lines = flat ? series.map(([, y], k) => ({ x, y, class: names[k] })) : [];
    const marks = flat ? [] : series.flatMap(([, y], k) => y.map((v, i) => ({ x: x[i], y: v, class: `dot ${names[k]}`, size: 2.2 })));
    const unit = forces ? this.units.stress : this.units.length;
    this.plot.draw({ xlabel: withUnit(one.axis, this.units.length), ylabel: withUnit(series.map(([n]) => n).join(", "), unit), lines, marks });
    // what each point does, as marks at the upper edge
    const every = Math.max(1, Math.ceil(x.length / 90));
    const strip = order.filter((_, k) => k % every === 0).map(([place, j]) => {
      const { colour, form } = stateMark(this.shape.states[state[j]]);
      return drawnMark(form, this.plot.toX(place), 7, 3, colour);
    });
    this.plot.layer.replaceChildren(...strip);
    const counts = new Map();
    for (const [, j] of order) counts.set(state[j], (counts.get(state[j]) || 0) + 1);
    this.legend.replaceChildren(
      ...series.map(([name], k) => h("span", { class: `key ${names[k]}` }, name)),
      ...[...counts].map(([number, count]) => {
        const label = this.shape.states[number];
        const { colour, form } = stateMark(label);
        return h("span", { class: "key" }, s("svg", { width: 12, height: 12 }, drawnMark(form, 6, 6, 4, colour)), `${label} (${count})`);
      }),
    );
  }
}

const PATH_AXES = { penetration: "largest penetration", normal_force: "normal force", friction_force: "friction force", energy: "energy" };

/** The load path, stable parts solid, others dashed, with folds, jumps and a cursor. */
export class PathChart {
  constructor(host, follow, go) {
    this.start = h("button", { class: "primary", onclick: () => follow(Number(this.upper.value) || 1) }, "Follow the path");
    this.upper = h("input", { type: "number", class: "short", value: "1", min: "0.01", step: "0.1", "aria-label": "largest load factor" });
    this.axis = h("select", { "aria-label": "quantity of the path", onchange: () => this.draw() },
      ...Object.entries(PATH_AXES).map(([value, name]) => h("option", { value }, name)));
    this.words = h("span", { class: "quiet" });
    this.cursor = h("input", { type: "range", class: "wide", min: 0, max: 0, step: 1, value: 0, "aria-label": "point of the path", disabled: true,
      oninput: () => {
        this.draw();
        go(Number(this.cursor.value));
      } });
    const place = h("div", { class: "fill" });
    host.append(h("div", { class: "bar" }, this.start, h("label", {}, "up to load factor ", this.upper), this.axis, this.words), place, this.cursor);
    this.plot = new Plot(place, "load path");
    place.addEventListener("click", (event) => {
      if (!this.path) return;
      const [x, y] = this.plot.at(event);
      const near = this.nearest(x, y);
      this.cursor.value = near;
      this.draw();
      go(near);
    });
    this.draw();
  }

  set(head, arrays) {
    this.path = head && { head, arrays };
    this.cursor.disabled = !head;
    this.words.textContent = head ? head.words : "";
    if (head) {
      this.cursor.max = arrays.load_factor.length - 1;
      this.cursor.value = this.cursor.max;
    }
    this.draw();
  }

  nearest(x, y) {
    const { load_factor: t } = this.path.arrays;
    const q = this.path.arrays[this.axis.value];
    let best = 0;
    let least = Infinity;
    for (let k = 0; k < t.length; k += 1) {
      const d = Math.hypot(this.plot.toX(q[k]) - this.plot.toX(x), this.plot.toY(t[k]) - this.plot.toY(y));
      if (d < least) [least, best] = [d, k];
    }
    return best;
  }

  draw() {
    const name = PATH_AXES[this.axis.value];
    if (!this.path) {
      this.plot.draw({ xlabel: name, ylabel: "load factor", lines: [], xrange: [0, 1], yrange: [0, 1] });
      return;
    }
    const { load_factor: t, stable } = this.path.arrays;
    const q = this.path.arrays[this.axis.value];
    const lines = [];
    let from = 0;
    for (let k = 1; k < t.length; k += 1) {
      if (k === t.length - 1 || stable[k] !== stable[k - 1]) {
        lines.push({ x: q.slice(from, k + 1), y: t.slice(from, k + 1), class: stable[k - 1] ? "first" : "first falls" });
        from = k;
      }
    }
    const marks = this.path.head.folds.map((k) => ({ x: q[k], y: t[k], form: "ring", size: 6, class: "fold", title: `fold at load factor ${shown(t[k])}` }));
    for (const [k, at] of this.path.head.jumps) marks.push({ x: q[k], y: at, form: "triangle", size: 5, class: "jump", title: `the body jumps at load factor ${shown(at)}` });
    const k = Math.min(Number(this.cursor.value), t.length - 1);
    marks.push({ x: q[k], y: t[k], size: 5.5, class: "cursor", title: `load factor ${shown(t[k])}` });
    this.plot.draw({ xlabel: name, ylabel: "load factor", lines, marks });
  }
}

/** All solutions as pictures beside each other. */
export class SolutionCards {
  constructor(host, search, choose) {
    this.choose = choose;
    this.words = h("span", { class: "quiet" });
    this.cards = h("div", { class: "cards fill" });
    host.append(h("div", { class: "bar" }, h("button", { class: "primary", onclick: search }, "Find all solutions"), this.words), this.cards);
    this.clear();
  }

  clear() {
    this.found = [];
    this.words.textContent = "Every equilibrium of the problem that can be found.";
    this.cards.replaceChildren();
  }

  add(head, fields) {
    this.found.push({ head, fields });
  }

  /** Draw what was found: the view makes the pictures, all in one scale of colours. */
  show(words, view, range) {
    this.words.textContent = words;
    this.cards.replaceChildren(...this.found.map((one, k) => {
      const picture = view.snapshot(one.fields, range(this.found.map((each) => each.fields)), 190, 130);
      const text = `${k + 1}. ${one.head.kind || one.head.status}`;
      return h("button", { class: "card", onclick: (event) => {
        for (const card of this.cards.children) card.classList.toggle("chosen", card === event.currentTarget);
        this.choose(one);
      } }, picture, h("strong", {}, text), h("span", {}, `energy ${shown(one.head.energy, 6)}`), h("span", {}, `normal force ${shown(one.head.normal_force)}`));
    }));
  }
}

/** The play bar of an evolution. */
export class PlayBar {
  constructor(host, show) {
    this.show = show;
    this.frames = [];
    this.play = h("button", { class: "primary", onclick: () => this.toggle() }, "Play");
    this.place = h("input", { type: "range", class: "wide", min: 0, max: 0, step: 1, value: 0, "aria-label": "time", oninput: () => this.seek(Number(this.place.value)) });
    this.time = h("output", {}, "");
    this.words = h("span", { class: "quiet" });
    const place = h("div", { class: "fill" });
    host.append(h("div", { class: "bar" }, this.play, this.place, this.time, this.words), place);
    this.plot = new Plot(place, "history");
  }

  clear() {
    this.frames = [];
    this.history = null;
    this.chosen = false;
    this.words.textContent = "";
    this.stop();
  }

  add(head, fields) {
    this.frames.push({ head, fields });
    this.place.max = this.frames.length - 1;
    if (!this.chosen && performance.now() - (this.shownAt || 0) > 100) this.go(this.frames.length - 1);
    else this.draw();
  }

  end(head, arrays) {
    this.words.textContent = [head.ended, ...head.messages].join("; ");
    this.history = { head, arrays };
    if (this.chosen) this.draw();
    else this.go(this.frames.length - 1);
  }

  /** A frame that the user chose: those that come are no longer followed. */
  seek(k) {
    this.chosen = true;
    this.go(k);
  }

  go(k) {
    this.at = Math.min(k, this.frames.length - 1);
    const frame = this.frames[this.at];
    if (!frame) return;
    this.shownAt = performance.now();
    this.place.value = this.at;
    this.time.textContent = `t = ${shown(frame.head.time)}`;
    this.show(frame);
    this.draw();
  }

  toggle() {
    if (this.playing) {
      this.stop();
      return;
    }
    this.chosen = true;
    this.play.textContent = "Pause";
    if (this.at >= this.frames.length - 1) this.at = -1;
    this.playing = setInterval(() => {
      if (this.at >= this.frames.length - 1) this.stop();
      else this.go(this.at + 1);
    }, 50);
  }

  stop() {
    clearInterval(this.playing);
    this.playing = 0;
    this.play.textContent = "Play";
  }

  draw() {
    const x = this.history ? this.history.arrays.times : this.frames.map((one) => one.head.time);
    const y = this.history && this.history.arrays.normal_force ? this.history.arrays.normal_force : this.frames.map((one) => one.head.normal_force);
    const now = this.frames[this.at];
    const marks = now ? [{ x: now.head.time, y: now.head.normal_force, size: 5, class: "cursor" }] : [];
    this.plot.draw({ xlabel: "time", ylabel: "normal force", lines: [{ x, y, class: "first" }], marks });
  }
}
