// The contact boundary, the load path with its cursor, all solutions side by side, and the play bar.

import { colourMap, cssColour, stateMark } from "./colours.js";
import { h, s, shown, withUnit } from "./dom.js";
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
    if (this.shape.kind === "space") {
      this.map(one);
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
    const marks = flat ? [] : dots(series, x, names);
    const unit = forces ? this.units.stress : this.units.length;
    this.plot.draw({ xlabel: withUnit(one.axis, this.units.length), ylabel: withUnit(series.map(([n]) => n).join(", "), unit), lines, marks });
    // what each point does, as marks at the upper edge
    const every = Math.max(1, Math.ceil(x.length / 90));
    const strip = order.filter((_, k) => k % every === 0).map(([place, j]) => {
      const { colour, form } = stateMark(this.shape.states[state[j]]);
      return drawnMark(form, this.plot.toX(place), 7, 3, colour);
    });
    this.plot.layer.replaceChildren(...strip);
    this.legend.replaceChildren(...series.map(([name], k) => h("span", { class: `key ${names[k]}` }, name)), ...this.counted(one.index));
  }

  /** How many of the points are in each state. */
  counted(index) {
    const counts = new Map();
    for (const j of index) counts.set(this.fields.state[j], (counts.get(this.fields.state[j]) || 0) + 1);
    return [...counts].map(([number, count]) => {
      const label = this.shape.states[number];
      const { colour, form } = stateMark(label);
      return h("span", { class: "key" }, s("svg", { width: 12, height: 12 }, drawnMark(form, 6, 6, 4, colour)), `${label} (${count})`);
    });
  }

  /** The boundary of a body in 3D as it is seen along its mean normal: a colour for what is drawn, forms for states. */
  map(one) {
    const { places, normals, states } = this.shape;
    const { local, pressure, state } = this.fields;
    const c = local.columns;
    const forces = this.what.value === "forces";
    const values = one.index.map((j) => (forces ? pressure[j] : local[c * j]));
    const [low, high] = [Math.min(...values), Math.max(...values)];
    const mean = [0, 1, 2].map((k) => one.index.reduce((sum, j) => sum + normals[3 * j + k], 0));
    const across = [0, 1, 2].reduce((most, k) => (Math.abs(mean[k]) > Math.abs(mean[most]) ? k : most), 0);
    const [a, b] = [0, 1, 2].filter((k) => k !== across); // the two axes that the normal is least along
    const colours = colourMap("cividis");
    const [x, y] = [a, b].map((k) => one.index.map((j) => places[3 * j + k]));
    const size = Math.min(Math.max(0.4 * Math.sqrt((this.plot.host.clientHeight ** 2) / one.index.length), 1.5), 6);
    const marks = one.index.map((j, k) => ({
      x: x[k], y: y[k], size, form: stateMark(states[state[j]]).form, colour: cssColour(colours, (values[k] - low) / (high - low || 1)),
      title: `${forces && values[k] < 0 ? `peel ${shown(-values[k])}` : `${forces ? "pressure" : "penetration"} ${shown(values[k])}`}, ${states[state[j]]}`,
    }));
    const { length, stress } = this.units;
    this.plot.draw({ xlabel: withUnit("xyz"[a], length), ylabel: withUnit("xyz"[b], length), marks, even: true });
    this.plot.layer.replaceChildren();
    const name = withUnit(forces ? "pressure" : "penetration", forces ? stress : length);
    const bar = h("canvas", { width: 60, height: 8, class: "scale" });
    const pen = bar.getContext("2d");
    for (let k = 0; k < 60; k += 1) {
      pen.fillStyle = cssColour(colours, k / 59);
      pen.fillRect(k, 0, 1, 8);
    }
    this.legend.replaceChildren(h("span", { class: "key" }, `${name}: ${shown(low, 3)}`, bar, shown(high, 3)), ...this.counted(one.index));
  }
}

function dots(series, x, names) {
  return series.flatMap(([, y], k) => y.map((v, i) => ({ x: x[i], y: v, class: `dot ${names[k]}`, size: 2.2 })));
}

/** The energy of the solution over a slider's value: valleys are marked, and the state of the page is a ball on it. */
export class EnergyChart {
  /** ask(key) asks for the curve, go(key, value) moves the slider. */
  constructor(host, ask, go) {
    this.key = h("select", { "aria-label": "slider of the energy", onchange: () => this.forget() });
    this.words = h("span", { class: "quiet" });
    const place = h("div", { class: "fill" });
    host.append(h("div", { class: "bar" }, h("button", { class: "primary", onclick: () => ask(this.key.value) }, "Draw the energy"), h("label", {}, "over ", this.key), this.words), place);
    this.plot = new Plot(place, "energy over a slider");
    place.addEventListener("click", (event) => this.curve && go(this.key.value, this.plot.at(event)[0]));
    this.forget();
  }

  /** The sliders that there are; the one that was moved last is chosen until there is a curve. */
  offer(names, last) {
    const chosen = this.curve || !last ? this.key.value : last;
    const keys = names.map(([key]) => key).join("\n");
    if (keys !== this.keys) this.key.replaceChildren(...names.map(([key, name]) => h("option", { value: key }, `${key.split(".")[0]}: ${name}`)));
    this.keys = keys;
    if (names.some(([key]) => key === chosen)) this.key.value = chosen;
    this.draw();
  }

  /** A curve, and the text without the number over which it is drawn. */
  set(arrays, rest) {
    this.curve = arrays;
    this.rest = rest;
    const count = this.valleys().length;
    this.words.textContent = count ? `${count} ${count === 1 ? "valley" : "valleys"}` : "no valley between the ends";
    this.draw();
  }

  forget() {
    this.curve = null;
    this.words.textContent = "The ball is the state that you see. It rolls as the slider moves.";
    this.draw();
  }

  /** The curve stays as long as nothing but its number changes. */
  keep(rest) {
    if (this.curve && rest !== this.rest) this.forget();
  }

  /** Where the state is. */
  ball(value, energy) {
    this.state = [value, energy];
    this.draw();
  }

  /** Places inside the range that lie below both neighbours. */
  valleys() {
    const { energy } = this.curve;
    return [...energy.keys()].filter((k) => k > 0 && k + 1 < energy.length && energy[k] < energy[k - 1] && energy[k] < energy[k + 1]);
  }

  draw() {
    const xlabel = this.key.selectedOptions[0]?.textContent || "slider";
    if (!this.curve) {
      this.plot.draw({ xlabel, ylabel: "energy", lines: [], xrange: [0, 1], yrange: [0, 1] });
      return;
    }
    const { value, energy } = this.curve;
    const marks = this.valleys().map((k) => ({ x: value[k], y: energy[k], form: "ring", size: 6, class: "fold valley", title: `valley at ${shown(value[k])}` }));
    const [x, y] = this.state || [];
    if (Number.isFinite(x) && Number.isFinite(y)) marks.push({ x, y, size: 8, class: "cursor ball", title: `energy ${shown(y)}` });
    this.plot.draw({ xlabel, ylabel: "energy", lines: [{ x: value, y: energy, class: "first" }], marks });
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
