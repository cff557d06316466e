// The studio: what the page shows of a problem, and what it asks for. The same in a browser and in a notebook.

import { addressOf, COLOURS, restore } from "./address.js";
import { BodyView, colouring, fieldRange } from "./body.js";
import { CertificatePanel } from "./certificate.js";
import { ContactChart, EnergyChart, PathChart, PlayBar, SolutionCards } from "./charts.js";
import { colourMap, cssColour, MAP_NAMES } from "./colours.js";
import { Deformation } from "./deformation.js";
import { download, h, shown, withUnit } from "./dom.js";
import { pngBlob, svgBlob } from "./export.js";
import { LawView } from "./law.js";
import { Sliders } from "./sliders.js";
import { tabs } from "./tabs.js";
import { ProblemText, Undo, unpackedText } from "./text.js";

/** Milliseconds after which a request that has no picture yet gives way to a newer one. */
const PATIENCE = 700;
const LOST = "The studio does not answer: its program has ended or is restarting. Start it again with the same --port and --token; this page goes on from here.";
/** Unknowns of a body in space from which a coarser mesh is shown while a slider is dragged. */
const MANY_IN_SPACE = 4000;

/**
 * Build the studio in an element.
 *
 * link: { send(request), onmessage(head, arrays), onstate(open) }, the latter two set here.
 * options.hash: whether the state stands in the address.
 */
export function mount(root, link, options = {}) {
  return new Studio(root, link, options);
}

class Studio {
  constructor(root, link, options) {
    Object.assign(this, { root, link, options });
    this.problem = new ProblemText();
    this.undo = new Undo();
    this.generation = 0;
    this.units = {};
    this.texts = new Map();
    root.classList.add("hemivar-studio");
    this.build();
    this.setTheme(options.theme || "");
    link.onmessage = (head, arrays) => this.hear(head, arrays);
    link.onstate = (open, reason) => this.connected(open, reason);
  }

  // ---- what there is on the page -------------------------------------------------------------------------

  build() {
    const button = (name, title, run) => h("button", { title, onclick: run }, name);
    this.title = h("h1", {}, "hemivar studio");
    this.side = tabs("side", { law: "Law", text: "Problem (TOML)", certificate: "Certificate" }, () => this.remember());
    this.certificate = new CertificatePanel(this.side.panel.certificate, () => this.side.show("certificate"), (sentence) => this.side.mark("certificate", sentence));
    this.lost = h("p", { class: "lost", role: "alert", hidden: true });
    this.examples = h("select", { "aria-label": "examples", onchange: () => this.example() }, h("option", { value: "" }, "Examples …"));
    this.theme = h("select", { "aria-label": "light or dark", onchange: () => this.setTheme(this.theme.value) },
      h("option", { value: "" }, "as the system"), h("option", { value: "light" }, "light"), h("option", { value: "dark" }, "dark"));
    const head = h("header", {}, this.title, this.certificate.badge, h("span", { class: "space" }), this.examples,
      button("Undo", "Ctrl+Z", () => this.step("back")), button("Redo", "Ctrl+Y", () => this.step("forth")),
      button("PNG", "Save the picture as PNG", () => this.save("png")), button("SVG", "Save the picture as SVG", () => this.save("svg")),
      this.theme);
    const sliders = h("aside", { class: "sliders", "aria-label": "numbers of the problem" });
    this.sliders = new Sliders(sliders, (pairs, final) => this.edit(pairs, final));
    this.scene = h("div", { class: "scene" });
    this.body = new BodyView(this.scene, () => this.remember());
    this.body.ondrawn = () => this.drawn();
    this.status = h("p", { class: "status", role: "status" }, "connecting …");
    this.bars = this.toolbar();
    this.lower = tabs("lower", { contact: "Contact boundary", path: "Load path", solutions: "All solutions", energy: "Energy", time: "Time" }, () => this.remember());
    this.contact = new ContactChart(this.lower.panel.contact);
    this.path = new PathChart(this.lower.panel.path, (upper) => this.ask("path", { upper }), (index) => this.ask("point", { index }));
    this.cards = new SolutionCards(this.lower.panel.solutions, () => {
      this.cards.clear();
      this.ask("solutions");
    }, (one) => this.choose(one));
    this.energy = new EnergyChart(this.lower.panel.energy, (key) => {
      const [low, high] = this.sliders.range(key);
      this.ask("energies", { key, low, high });
    }, (key, value) => this.edit([[key, value]], true));
    this.play = new PlayBar(this.lower.panel.time, (frame) => this.show(frame.head, frame.fields));
    this.lower.enable("time", false);
    this.law = new LawView(this.side.panel.law, (pairs, final) => this.edit(pairs, final));
    this.editor();
    const middle = h("main", {}, this.scene, this.bars, this.status, this.lower.root);
    this.root.replaceChildren(head, this.lost, h("div", { class: "columns" }, sliders, middle, this.side.root));
    // a page has these keys everywhere, a widget of a notebook in itself
    (this.options.hash ? document : this.root).addEventListener("keydown", (event) => this.key(event));
  }

  toolbar() {
    this.colour = h("select", { "aria-label": "colour of the body", onchange: () => this.repaint() },
      ...Object.entries(COLOURS).map(([value, name]) => h("option", { value }, name)));
    this.map = h("select", { "aria-label": "scale of colours", onchange: () => this.repaint() }, ...MAP_NAMES.map((name) => h("option", {}, name)));
    this.deformation = new Deformation(() => this.rescale(), () => this.fit());
    this.mesh = h("input", { type: "checkbox", checked: true, onchange: () => this.rescale() });
    this.legend = h("canvas", { width: 120, height: 10, class: "scale" });
    this.ends = [h("span", {}), h("span", {})];
    this.ghost = h("button", { title: "Keep this state as an outline, to compare it with others", "aria-pressed": "false", onclick: () => this.haunt() }, "Keep as ghost");
    return h("div", { class: "bar tools" }, this.colour, this.map, this.ends[0], this.legend, this.ends[1], this.deformation.label, this.deformation.auto,
      h("label", {}, this.mesh, " mesh"), this.ghost, h("button", { title: "0", onclick: () => {
        this.body.reset();
        this.body.draw();
      } }, "Reset view"));
  }

  editor() {
    this.area = h("textarea", { spellcheck: false, autocomplete: "off", "aria-label": "problem file", wrap: "off" });
    this.area.addEventListener("input", () => {
      clearTimeout(this.typing);
      this.typing = setTimeout(() => this.setText(this.area.value, true), 400);
    });
    this.wrong = h("p", { class: "error", role: "alert", hidden: true });
    this.copied = h("button", { onclick: () => this.copyLink(), hidden: !this.options.hash }, "Copy link");
    this.side.panel.text.append(h("div", { class: "bar" },
      h("button", { onclick: () => download(this.name || "problem.toml", new Blob([this.problem.text], { type: "application/toml" })) }, "Download"),
      this.copied), this.wrong, this.area);
  }

  // ---- changes -------------------------------------------------------------------------------------------

  /** Put numbers into the text; while a slider moves the steps count as one for undo. */
  edit(pairs, final) {
    if (!this.dragging) this.undo.keep(this.problem.text);
    this.dragging = !final;
    const done = pairs.map(([key, value]) => this.problem.put(key, value));
    if (!done.some(Boolean)) return;
    this.area.value = this.problem.text;
    for (const [key, value] of pairs) this.sliders.value(key, value);
    this.changed();
  }

  setText(text, keep) {
    if (text === this.problem.text) return;
    if (keep) this.undo.keep(this.problem.text);
    this.problem.text = text;
    this.problem.spots = new Map();
    if (this.area.value !== text) this.area.value = text;
    this.changed();
  }

  /** Take what is being typed in a field or in the text, so that it is the last step. */
  settle(field) {
    clearTimeout(this.typing);
    if (field === this.area) this.setText(this.area.value, true);
    else if (field.type === "number") {
      field.blur();
      field.focus();
    }
  }

  step(way) {
    const text = this.undo[way](this.problem.text);
    if (text !== null) this.setText(text, false);
  }

  example() {
    const text = this.templates[this.examples.value];
    this.deformation.kept = false;
    this.another = true;
    if (text) this.setText(text.text, true);
    this.name = `${this.examples.value || "problem"}.toml`;
    this.examples.value = "";
  }

  changed() {
    this.path.set(null);
    this.cards.clear();
    this.energy.keep(this.problem.without(this.energy.key.value));
    this.play.clear();
    this.remember();
    this.solve();
  }

  /** Ask for the solution of the text as it is; one request is on its way at a time, and the newest text wins. */
  solve() {
    if (this.waiting && performance.now() - this.since < PATIENCE) {
      this.again = true;
      clearTimeout(this.timer);
      this.timer = setTimeout(() => this.waiting && this.again && this.solve(), PATIENCE);
      return;
    }
    this.again = false;
    this.waiting = true;
    this.since = performance.now();
    this.ask("solve");
  }

  ask(type, more = {}) {
    this.generation += 1;
    const text = type === "solve" && this.dragging ? this.coarser() : this.problem.text;
    this.texts.set(this.generation, text);
    if (this.texts.size > 50) this.texts.delete(this.texts.keys().next().value);
    const shape = this.shape ? this.shape.key : "";
    this.link.send({ type, generation: this.generation, text, shape, ...more });
    if (type !== "point") this.busy(type);
  }

  /** The text with half as many cells for a large body in space, while a slider moves. */
  coarser() {
    if (!this.shape || this.shape.kind !== "space" || !(this.full > MANY_IN_SPACE)) return this.problem.text;
    return this.problem.coarser();
  }

  // ---- answers -------------------------------------------------------------------------------------------

  hear(head, arrays) {
    if (head.type === "hello") {
      this.begin(head);
      return;
    }
    if (head.generation < this.generation) return;
    const answers = {
      problem: () => this.told(head), shape: () => this.setShape(head, arrays), picture: () => this.picture(head, arrays),
      certificate: () => this.certificate.set(head.level, head.title, head.meaning, head.lines),
      notice: () => this.certificate.note(head.text), progress: () => this.progress(head.words), error: () => this.failed(head),
      refused: () => this.failed({ ...head, key: null }), solutions: () => this.cards.show(head.words, this.body, (all) => this.common(all)),
      path: () => this.path.set(head, arrays), history: () => this.ended(head, arrays), done: () => this.arrived(),
      energies: () => this.energies(head, arrays),
    };
    answers[head.type]?.();
  }

  energies(head, arrays) {
    if (head.key !== this.energy.key.value) return;
    this.energy.set(arrays, this.problem.without(head.key));
    if (this.last) this.show(this.last.head, this.last.fields); // with its line below the body
  }

  async begin(head) {
    this.lost.hidden = true;
    this.templates = head.templates;
    this.examples.replaceChildren(h("option", { value: "" }, "Examples …"), ...Object.entries(head.templates).map(([name, one]) => h("option", { value: name }, `${name}: ${one.what}`)));
    if (this.start === undefined) {
      this.start = head.text;
      this.name = head.name;
      const kept = this.options.hash ? new URLSearchParams(location.hash.slice(1)) : new URLSearchParams();
      const text = kept.get("p") ? await unpackedText(kept.get("p")) : null;
      restore(this, kept);
      this.problem.text = text === null ? head.text : text;
      this.area.value = this.problem.text;
    }
    // a shape that an earlier program sent is not known to this one
    this.shape = null;
    this.waiting = false;
    this.solve();
  }

  told(head) {
    this.title.textContent = head.title || "hemivar studio";
    this.units = head.units;
    const text = this.texts.get(head.generation);
    if (text === this.problem.text) {
      this.problem.know(head.sliders);
      this.sliders.set(head.sliders);
      this.energy.offer(this.sliders.names, this.sliders.last);
    }
    this.right();
    this.certificate.clear();
    this.lower.enable("time", head.timed);
    this.lower.enable("path", !head.timed);
    this.lower.enable("solutions", !head.timed);
    this.lower.enable("energy", !head.timed);
    this.sliders.playable(!head.timed);
    if (head.timed && this.lower.shown !== "time" && this.lower.shown !== "contact") this.lower.show("time");
    if (head.timed && !this.timed) this.lower.show("time");
    if (!head.timed && this.lower.shown === "time") this.lower.show("contact");
    this.timed = head.timed;
    this.area.value = this.problem.text;
  }

  setShape(head, arrays) {
    this.shape = { ...head, ...arrays };
    if (this.body.shadow) this.haunt(); // of another body
    this.body.setShape(this.shape);
    this.fresh = true;
  }

  picture(head, fields) {
    if (head.solution !== undefined) {
      this.cards.add(head, fields);
      return;
    }
    if (head.time !== undefined) {
      this.arrived();
      this.play.add(head, fields);
      return;
    }
    this.show(head, fields);
    this.arrived();
  }

  /** The picture that was asked for is there: ask for the next if something changed meanwhile, or a slider plays. */
  arrived() {
    clearTimeout(this.slow);
    this.waiting = false;
    if (!this.again) {
      this.sliders.tick();
      return;
    }
    this.again = false;
    this.solve();
  }

  /** Keep the state as a ghost, or let it go. */
  haunt() {
    const kept = this.ghost.getAttribute("aria-pressed") !== "true";
    this.ghost.setAttribute("aria-pressed", String(kept));
    this.ghost.replaceChildren(kept ? "Remove ghost" : "Keep as ghost");
    this.body.haunt(kept);
  }

  show(head, fields) {
    if (!this.dragging) this.full = head.unknowns;
    this.last = { head, fields };
    const first = (this.fresh || this.another) && !this.deformation.kept;
    this.fresh = false;
    if (this.texts.get(head.generation) === this.problem.text) this.another = false;
    if (first) this.deformation.fit([fields], this.shape.size);
    this.body.options.scale = this.deformation.factor;
    this.offer(fields);
    this.range = head.time === undefined ? this.rangeOf(fields) : this.common(this.play.frames.map((frame) => frame.fields));
    this.body.options.colour = this.colour.value;
    this.body.setFields(fields, this.range);
    this.contact.set(this.shape, fields, this.units);
    this.law.setCurves(head.curves, this.problem.numbers, this.units);
    this.paintLegend();
    if (head.energy !== undefined && head.index === undefined) this.energy.ball(this.problem.numbers.get(this.energy.key.value), head.energy);
    this.drawnGeneration = head.generation;
    const parts = [head.converged ? head.status : `${head.status}: ${head.remedy}`, `${head.unknowns} unknowns`];
    if (head.normal_force !== undefined) parts.push(`normal force ${shown(head.normal_force)}`);
    if (head.energy !== undefined) parts.push(`energy ${shown(head.energy, 5)}`);
    if (head.steps !== undefined) parts.push(`${head.method}, ${head.steps} steps`);
    if (head.stable !== undefined) parts.push(head.stable ? "stable" : "not stable");
    this.status.textContent = parts.join(" · ");
    if (head.index !== undefined) this.certificate.onPath(head.stable);
    this.status.classList.toggle("wrong", !head.converged);
  }

  choose(one) {
    this.show(one.head, one.fields);
    this.certificate.set("none", `solution: ${one.head.kind}`, "One of the solutions that were found; the certificate is that of the picture before.", []);
  }

  /** A run in time is there: its largest displacement sets the factor. */
  ended(head, arrays) {
    if (!this.deformation.kept) this.fit();
    this.play.end(head, arrays);
  }

  /** Find the factor of the deformation by what is shown, over all frames of a run in time. */
  fit() {
    if (!this.last) return;
    const timed = this.last.head.time !== undefined;
    this.deformation.fit(timed ? this.play.frames.map((frame) => frame.fields) : [this.last.fields], this.shape.size);
    this.rescale();
  }

  failed(head) {
    this.sliders.stop();
    this.arrived();
    if (this.waiting) return;
    if (head.of === "point") {
      this.path.set(null);
      return;
    }
    const beside = this.sliders.error(head.key, head.message);
    this.wrong.textContent = head.message;
    this.wrong.hidden = false;
    this.status.textContent = head.message;
    this.status.classList.add("wrong");
    if (!head.of || head.of === "solve") this.certificate.set("none", "no solution", head.message, []);
    this.area.classList.add("wrong");
    const line = head.key ? this.problem.line(head.key) : -1;
    if (!beside && line >= 0) this.area.scrollTop = Math.max(0, (line - 3) * 18);
  }

  right() {
    this.sliders.error(null, "");
    this.wrong.hidden = true;
    this.area.classList.remove("wrong");
    this.status.classList.remove("wrong");
  }

  progress(words) {
    clearTimeout(this.slow);
    this.status.textContent = words;
  }

  busy(type) {
    clearTimeout(this.slow);
    const words = { solve: "solving …", path: "following the path …", solutions: "searching …", energies: "solving for the values of the slider …" }[type];
    this.slow = setTimeout(() => this.status.replaceChildren(words), 300);
    if (type === "solve") this.certificate.age();
  }

  drawn() {
    if (this.drawnGeneration === undefined) return;
    this.root.dispatchEvent(new CustomEvent("studio-drawn", { detail: { generation: this.drawnGeneration, asked: this.since } }));
  }

  connected(open, reason) {
    if (!open) {
      this.lost.hidden = false;
      this.lost.textContent = reason ? `The studio closed this page: ${reason}.` : LOST;
      this.waiting = false;
      this.status.textContent = "no connection";
    }
  }

  // ---- colours, view, address ------------------------------------------------------------------------------

  /** Colourings that the picture has. */
  offer(fields) {
    for (const one of this.colour.options) {
      const there = one.value === "none" || one.value === "displacement" || Boolean(fields[one.value]);
      one.disabled = !there;
      if (!there && this.colour.value === one.value) this.colour.value = "displacement";
    }
  }

  rangeOf(fields) {
    const name = this.colour.value;
    fields.ranges ||= new Map();
    if (!fields.ranges.has(name)) {
      const values = colouring(fields, name);
      fields.ranges.set(name, values ? fieldRange(values, name) : null);
    }
    return fields.ranges.get(name);
  }

  common(all) {
    const ranges = all.map((fields) => this.rangeOf(fields)).filter(Boolean);
    return ranges.length ? [Math.min(...ranges.map((r) => r[0])), Math.max(...ranges.map((r) => r[1]))] : null;
  }

  repaint() {
    this.body.options.map = this.map.value;
    if (this.last) this.show(this.last.head, this.last.fields);
    this.remember();
  }

  rescale() {
    this.body.setOptions({ scale: this.deformation.factor, mesh: this.mesh.checked });
    this.remember();
  }

  paintLegend() {
    const pen = this.legend.getContext("2d");
    const map = colourMap(this.map.value);
    for (let x = 0; x < 120; x += 1) {
      pen.fillStyle = cssColour(map, x / 119);
      pen.fillRect(x, 0, 1, 10);
    }
    this.legend.hidden = !this.range;
    this.ends.forEach((one, k) => one.replaceChildren(this.range ? shown(this.range[k], 3) : ""));
  }

  setTheme(name) {
    this.root.dataset.theme = name;
    this.theme.value = name;
    if (this.body.fields) this.body.setOptions({});
    this.remember();
  }

  /** Put the state into the address a moment after the last change. */
  remember() {
    if (!this.options.hash || this.start === undefined) return;
    clearTimeout(this.remembering);
    this.remembering = setTimeout(async () => history.replaceState(null, "", `#${await addressOf(this)}`), 300);
  }

  async copyLink() {
    history.replaceState(null, "", `#${await addressOf(this)}`);
    await navigator.clipboard.writeText(location.href).catch(() => {});
    this.copied.textContent = "Copied: the link restores all of this here";
    setTimeout(() => this.copied.replaceChildren("Copy link"), 2000);
  }

  async save(kind) {
    if (!this.last) return;
    const named = COLOURS[this.colour.value];
    const unit = { displacement: this.units.length, penetration: this.units.length, stress: this.units.stress }[this.colour.value];
    const states = this.shape.kind === "scalar" || !this.last.fields.state ? [] : [...new Set(this.last.fields.state)].map((k) => this.shape.states[k]);
    const told = { title: this.title.textContent, foot: `${this.certificate.badge.textContent} · ${this.status.textContent}`, label: withUnit(named, unit), range: this.range, map: this.map.value, states };
    const stem = (this.name || "problem").replace(/\.toml$/, "");
    download(`${stem}.${kind}`, kind === "png" ? await pngBlob(this.body, told) : svgBlob(this.body, told));
  }

  key(event) {
    if ((event.ctrlKey || event.metaKey) && ["z", "y", "Z"].includes(event.key)) {
      event.preventDefault();
      this.settle(event.target);
      this.step(event.key === "z" ? "back" : "forth");
    } else if (event.key === " " && event.target === this.body.canvas && this.timed) {
      event.preventDefault();
      this.play.toggle();
    }
  }
}
