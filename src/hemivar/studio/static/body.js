// The body: mesh, outline, foundation, contact points and pressures, turned and moved by pointer and keys.

import * as THREE from "./vendor/three.module.min.js";
import { colourAt, colourMap, stateMark } from "./colours.js";
import { h, s } from "./dom.js";
import { edgesOf, sharpEdges } from "./edges.js";
import { drawnMark } from "./plot.js";

// colours are those of the screen, in WebGL as in CSS and SVG
THREE.ColorManagement.enabled = false;

const FRONT = { plane: [0, 0], space: [-0.6, 0.42], scalar: [-0.5, 0.7] };
const LONGEST_ARROW = 0.16;

/** Low and high end of a field; stress peaks at corners of a fine mesh are cut off. */
export function fieldRange(values, name) {
  const sorted = Float32Array.from(values.filter((v) => Number.isFinite(v))).sort();
  if (!sorted.length) return [0, 1];
  const last = sorted.length - 1;
  const top = name === "stress" && sorted.length > 2000 ? Math.floor(0.999 * last) : last;
  return [sorted[0], sorted[top]];
}

/** The values at vertices that a colouring shows; null for none. */
export function colouring(fields, name) {
  if (name === "none" || !fields) return null;
  if (name === "displacement") {
    const u = fields.displacement;
    return Float32Array.from({ length: u.length / 3 }, (_, k) => Math.hypot(u[3 * k], u[3 * k + 1], u[3 * k + 2]));
  }
  return fields[name] || null;
}

export class BodyView {
  /** onview is called when the view was turned or moved. */
  constructor(host, onview) {
    this.host = host;
    this.onview = onview;
    this.options = { scale: 1, colour: "displacement", map: "cividis", mesh: true, arrows: true };
    this.view = { yaw: 0, pitch: 0, zoom: 1, x: 0, y: 0 };
    this.canvas = h("canvas", { class: "body", tabindex: "0", role: "application", "aria-label":
      "Deformed body. Drag or arrow keys turn it, plus and minus zoom, shift with arrow keys moves, 0 resets." });
    host.append(this.canvas);
    try {
      this.renderer = new THREE.WebGLRenderer({ canvas: this.canvas, antialias: true, alpha: true });
      this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
    } catch {
      this.canvas.remove();
      host.append(h("p", { class: "empty" }, "This browser has no WebGL, which the body needs; charts, laws and SVG work."));
    }
    this.camera = new THREE.OrthographicCamera();
    this.scene = new THREE.Scene();
    const light = new THREE.DirectionalLight(0xffffff, 1.5);
    light.position.set(-1, -2, 3);
    this.scene.add(light, new THREE.AmbientLight(0xffffff, 2.1));
    this.parts = new THREE.Group();
    this.scene.add(this.parts);
    this.follow();
    new ResizeObserver(() => this.draw()).observe(host);
  }

  setShape(shape) {
    const other = !this.shape || this.shape.kind !== shape.kind;
    this.shape = shape;
    this.fields = null;
    if (other) this.reset();
    const p = shape.points;
    const box = [0, 1, 2].map((k) => {
      let low = Infinity;
      let high = -Infinity;
      for (let at = k; at < p.length; at += 3) {
        low = Math.min(low, p[at]);
        high = Math.max(high, p[at]);
      }
      return [low, high];
    });
    this.centre = box.map(([low, high]) => (low + high) / 2);
    this.extent = box.map(([low, high]) => high - low);
    this.below = new THREE.Vector3();
    for (let j = 0; shape.kind === "plane" && j < shape.normals.length; j += 3) this.below.add(new THREE.Vector3(...shape.normals.subarray(j, j + 3)));
    if (this.below.length() > 0) this.below.normalize();
    this.build();
  }

  setFields(fields, range) {
    this.fields = fields;
    this.range = range;
    this.update();
    this.draw();
  }

  setOptions(options) {
    Object.assign(this.options, options);
    if (this.fields) this.update();
    this.draw();
  }

  /** Keep the body as it is drawn now as a shadow behind what comes, or let it go. */
  haunt(kept) {
    this.shadow = kept && this.fields ? this.fields.displacement : null;
    if (this.fields) this.update();
    this.draw();
  }

  setView(view) {
    Object.assign(this.view, view);
    this.draw();
  }

  reset() {
    const [yaw, pitch] = FRONT[this.shape ? this.shape.kind : "plane"];
    this.view = { yaw, pitch, zoom: 1, x: 0, y: 0, ...this.first };
    this.first = {};
  }

  /** The objects of a shape; their positions and colours are set by update. */
  build() {
    for (const part of [...this.parts.children]) {
      part.geometry.dispose();
      part.material.dispose();
      this.parts.remove(part);
    }
    const { points, triangles, lines, kind } = this.shape;
    const position = new THREE.BufferAttribute(new Float32Array(points.length), 3);
    const colour = new THREE.BufferAttribute(new Float32Array(points.length), 3);
    const surface = new THREE.BufferGeometry();
    surface.setAttribute("position", position);
    surface.setAttribute("color", colour);
    surface.setIndex(new THREE.BufferAttribute(triangles, 1));
    const Material = kind === "plane" ? THREE.MeshBasicMaterial : THREE.MeshLambertMaterial;
    this.surface = new THREE.Mesh(surface, new Material({
      vertexColors: true, side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
    }));
    this.mesh = this.edgesOf(position, edgesOf(triangles), { transparent: true, opacity: 0.16 });
    this.outline = this.edgesOf(position, kind === "space" ? new Uint32Array(0) : lines, {});
    this.ground = segments();
    this.arrows = segments();
    this.rest = segments();
    this.ghost = segments();
    this.shadow = null;
    this.edges = kind === "space" ? sharpEdges(triangles, points) : lines;
    this.marks = new Map();
    this.parts.add(this.surface, this.mesh, this.outline, this.ground, this.arrows, this.rest, this.ghost);
    this.rest.geometry.setAttribute("position", new THREE.BufferAttribute(pairs(points, kind === "space" ? [] : lines), 3));
    this.rest.material.opacity = 0.5;
    this.rest.material.transparent = true;
  }

  edgesOf(position, pairsOf, style) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", position);
    geometry.setIndex(new THREE.BufferAttribute(pairsOf, 1));
    return new THREE.LineSegments(geometry, new THREE.LineBasicMaterial(style));
  }

  /** Positions and colours of the present fields. */
  update() {
    const { points } = this.shape;
    const u = this.fields.displacement;
    const position = this.surface.geometry.attributes.position;
    for (let k = 0; k < points.length; k += 1) position.array[k] = points[k] + this.options.scale * u[k];
    position.needsUpdate = true;
    this.surface.geometry.computeBoundingSphere();
    if (this.shape.kind !== "plane") this.surface.geometry.computeVertexNormals();
    const moved = this.shadow ? points.map((x, k) => x + this.options.scale * this.shadow[k]) : null;
    setSegments(this.ghost, moved ? pairs(moved, this.edges) : []);
    this.paint();
    this.foundation();
    this.points();
  }

  paint() {
    const colour = this.surface.geometry.attributes.color;
    const values = colouring(this.fields, this.options.colour);
    const map = colourMap(this.options.map);
    const [low, high] = this.range || [0, 1];
    const plain = this.dark() ? [0.36, 0.42, 0.5] : [0.8, 0.85, 0.9];
    for (let k = 0; 3 * k < colour.array.length; k += 1) {
      if (values && Number.isFinite(values[k])) colourAt(map, (values[k] - low) / (high - low || 1), colour.array, 3 * k);
      else colour.array.set(plain, 3 * k);
    }
    colour.needsUpdate = true;
  }

  /** The surface of the foundation, hatched, and the pressures mirrored into it. */
  foundation() {
    const { places, normals, boundaries, size, kind } = this.shape;
    const { scale } = this.options;
    const { moved, local, pressure } = this.fields;
    const ground = [];
    const arrows = [];
    const columns = local ? local.columns : 1;
    const at = (j, depth) => [0, 1, 2].map((k) => places[3 * j + k] + (scale * this.gap(j, columns) + depth) * normals[3 * j + k]);
    if (kind === "plane") {
      for (const one of boundaries) {
        if (one.pair) continue; // another body is touched, and drawn
        const order = one.index.map((j, k) => [one.along[k], j]).sort((a, b) => a[0] - b[0]).map((pair) => pair[1]);
        for (let k = 0; k + 1 < order.length; k += 1) {
          const from = at(order[k], 0);
          const to = at(order[k + 1], 0);
          ground.push(...from, ...to);
          const steps = Math.max(1, Math.round(Math.hypot(to[0] - from[0], to[1] - from[1]) / (0.02 * size)));
          if (steps > 1 || k % Math.max(1, Math.ceil(order.length / 60)) === 0) {
            for (let i = 0; i < steps; i += 1) {
              const p = from.map((v, c) => v + ((to[c] - v) * i) / steps);
              const n = [0, 1, 2].map((c) => normals[3 * order[k] + c]);
              ground.push(...p, p[0] + 0.022 * size * (n[0] - n[1] * 0.7), p[1] + 0.022 * size * (n[1] + n[0] * 0.7), p[2]);
            }
          }
        }
      }
    }
    const largest = pressure ? pressure.reduce((a, b) => Math.max(a, Math.abs(b)), 0) : 0;
    if (this.options.arrows && largest > 0 && kind !== "scalar") {
      const every = Math.max(1, Math.ceil(pressure.length / 400));
      for (let j = 0; j < pressure.length; j += every) {
        const length = (LONGEST_ARROW * size * pressure[j]) / largest;
        for (let k = 0; k < 3; k += 1) arrows.push(places[3 * j + k] + scale * moved[3 * j + k]);
        for (let k = 0; k < 3; k += 1) arrows.push(places[3 * j + k] + scale * moved[3 * j + k] + length * normals[3 * j + k]);
      }
    }
    setSegments(this.ground, ground);
    setSegments(this.arrows, arrows);
  }

  /** The distance of the foundation from contact point j at rest. */
  gap(j, columns) {
    const { normals } = this.shape;
    const { moved, local } = this.fields;
    const along = moved[3 * j] * normals[3 * j] + moved[3 * j + 1] * normals[3 * j + 1] + moved[3 * j + 2] * normals[3 * j + 2];
    return along - local[columns * j];
  }

  /** Contact points by their states. */
  points() {
    for (const part of this.marks.values()) part.visible = false;
    if (!this.fields.state || this.shape.kind === "scalar") return;
    const { places, states } = this.shape;
    const groups = new Map();
    this.fields.state.forEach((state, j) => {
      if (!groups.has(state)) groups.set(state, []);
      for (let k = 0; k < 3; k += 1) groups.get(state).push(places[3 * j + k] + this.options.scale * this.fields.moved[3 * j + k]);
    });
    for (const [state, list] of groups) {
      if (!this.marks.has(state)) {
        const material = new THREE.PointsMaterial({
          map: markTexture(stateMark(states[state])), size: 9, sizeAttenuation: false, transparent: true, depthTest: this.shape.kind !== "plane",
        });
        const part = new THREE.Points(new THREE.BufferGeometry(), material);
        part.renderOrder = 3;
        this.marks.set(state, part);
        this.parts.add(part);
      }
      const part = this.marks.get(state);
      part.visible = true;
      part.geometry.dispose();
      part.geometry = new THREE.BufferGeometry();
      part.geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(list), 3));
    }
  }

  dark() {
    return getComputedStyle(this.host).getPropertyValue("--dark").trim() === "1";
  }

  place(width, height) {
    const { yaw, pitch, zoom, x, y } = this.view;
    const [a, b, c] = this.extent;
    const arrow = 0.16 * this.shape.size;
    const room = this.shape.kind === "plane" ? [1.2 * a + arrow * Math.abs(this.below.x), 1.24 * b + arrow * Math.abs(this.below.y)] : [1.2 * Math.hypot(a, b), 1.2 * Math.hypot(a, b, c)];
    const unit = Math.max(room[0] / width, room[1] / height, 1e-30) / zoom;
    Object.assign(this.camera, {
      left: (-unit * width) / 2, right: (unit * width) / 2, top: (unit * height) / 2, bottom: (-unit * height) / 2,
      near: 0.01 * this.shape.size, far: 40 * this.shape.size,
    });
    // room for the pressures below the body
    const target = new THREE.Vector3(...this.centre).addScaledVector(this.below, 0.08 * this.shape.size);
    // plane bodies lie in x and y, all others stand on x and y with z upwards
    const flat = this.shape.kind === "plane";
    const away = flat
      ? new THREE.Vector3(Math.sin(yaw) * Math.cos(pitch), Math.sin(pitch), Math.cos(yaw) * Math.cos(pitch))
      : new THREE.Vector3(Math.sin(yaw) * Math.cos(pitch), -Math.cos(yaw) * Math.cos(pitch), Math.sin(pitch));
    this.camera.up.set(0, flat ? 1 : 0, flat ? 0 : 1);
    this.camera.position.copy(target).addScaledVector(away, 15 * this.shape.size);
    this.camera.lookAt(target);
    const right = new THREE.Vector3().setFromMatrixColumn(this.camera.matrixWorld, 0);
    this.camera.updateMatrixWorld();
    right.setFromMatrixColumn(this.camera.matrixWorld, 0);
    const up = new THREE.Vector3().setFromMatrixColumn(this.camera.matrixWorld, 1);
    this.camera.position.addScaledVector(right, -x * this.shape.size).addScaledVector(up, -y * this.shape.size);
    this.camera.updateProjectionMatrix();
    this.camera.updateMatrixWorld();
  }

  /** Draw at the next frame. */
  draw() {
    if (this.waiting) return;
    this.waiting = requestAnimationFrame(() => {
      this.waiting = 0;
      this.render();
    });
  }

  render(width = this.host.clientWidth, height = this.host.clientHeight, ratio = window.devicePixelRatio || 1) {
    if (!this.renderer || !this.shape || !width || !height) return;
    const ink = this.dark() ? 0xe8eaed : 0x202124;
    this.outline.material.color.set(ink);
    this.mesh.material.color.set(ink);
    this.ground.material.color.set(this.dark() ? 0xb0b4ba : 0x5a5e63);
    this.rest.material.color.set(this.dark() ? 0x9aa0a6 : 0x80868b);
    this.ghost.material.color.set(this.dark() ? 0xd9a5ff : 0x8e24aa);
    this.arrows.material.color.set(this.dark() ? 0xff8a65 : 0xb3261e);
    this.mesh.visible = this.options.mesh && this.shape.triangles.length < 60000;
    this.parts.visible = Boolean(this.fields);
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
    this.place(width, height);
    this.renderer.render(this.scene, this.camera);
    if (this.ondrawn) this.ondrawn();
  }

  /** A picture of other fields at a size, as a canvas. */
  snapshot(fields, range, width, height) {
    const own = [this.fields, this.range];
    const copy = h("canvas", { width: 2 * width, height: 2 * height });
    if (!this.renderer) return copy;
    [this.fields, this.range] = [fields, range];
    this.update();
    this.render(width, height, 2);
    copy.getContext("2d").drawImage(this.canvas, 0, 0, copy.width, copy.height);
    [this.fields, this.range] = own;
    if (own[0]) this.update();
    this.draw();
    return copy;
  }

  /** The body as the children of an SVG of a size: triangles from far to near, outline, foundation, states. */
  drawing(width, height) {
    this.place(width, height);
    const point = new THREE.Vector3();
    const onto = (array, k) => {
      point.set(array[3 * k], array[3 * k + 1], array[3 * k + 2]).project(this.camera);
      return [((point.x + 1) * width) / 2, ((1 - point.y) * height) / 2, point.z];
    };
    const text = ([x, y]) => `${x.toFixed(2)} ${y.toFixed(2)}`;
    const { position, color } = this.surface.geometry.attributes;
    const seen = Array.from({ length: position.count }, (_, k) => onto(position.array, k));
    const t = this.shape.triangles;
    const order = Array.from({ length: t.length / 3 }, (_, k) => k);
    const depth = order.map((k) => seen[t[3 * k]][2] + seen[t[3 * k + 1]][2] + seen[t[3 * k + 2]][2]);
    if (this.shape.kind !== "plane") order.sort((a, b) => depth[b] - depth[a]);
    const body = s("g", { "stroke-width": 0.2, "stroke-linejoin": "round" });
    for (const k of order) {
      const corners = [t[3 * k], t[3 * k + 1], t[3 * k + 2]];
      const rgb = [0, 1, 2].map((c) => Math.round((255 * corners.reduce((sum, v) => sum + color.array[3 * v + c], 0)) / 3));
      const fill = `rgb(${rgb.join(",")})`;
      body.append(s("path", { d: `M${corners.map((v) => text(seen[v])).join("L")}Z`, fill, stroke: fill }));
    }
    const drawn = [body];
    const line = (part, colour, wide) => {
      const a = part.geometry.attributes.position;
      const index = part.geometry.index;
      const count = index ? index.count : a ? a.count : 0;
      let d = "";
      for (let k = 0; k < count; k += 1) d += `${k % 2 ? "L" : "M"}${text(onto(a.array, index ? index.array[k] : k))}`;
      if (d) drawn.push(s("path", { d, fill: "none", stroke: colour, "stroke-width": wide }));
    };
    line(this.ground, "#5a5e63", 0.8);
    line(this.arrows, "#b3261e", 1);
    line(this.ghost, "#8e24aa", 0.9);
    line(this.outline, "#202124", 0.9);
    for (const [state, part] of this.marks) {
      if (!part.visible) continue;
      const { form, colour } = stateMark(this.shape.states[state]);
      const a = part.geometry.attributes.position;
      for (let k = 0; k < a.count; k += 1) drawn.push(drawnMark(form, ...onto(a.array, k).slice(0, 2), 3, colour));
    }
    return drawn;
  }

  /** Turn, move and zoom by pointer, wheel and keys. */
  follow() {
    const { canvas } = this;
    const changed = () => {
      this.draw();
      this.onview(this.view);
    };
    const turn = (dx, dy) => {
      this.view.yaw -= dx;
      this.view.pitch = Math.min(Math.max(this.view.pitch + dy, -1.55), 1.55);
    };
    const move = (dx, dy) => {
      this.view.x += dx / this.view.zoom;
      this.view.y -= dy / this.view.zoom;
    };
    const pointers = new Map();
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = pointers.get(event.pointerId);
      if (!before) return;
      const [dx, dy] = [event.clientX - before[0], event.clientY - before[1]];
      if (pointers.size === 2) {
        const other = [...pointers].find(([id]) => id !== event.pointerId)[1];
        const [was, is] = [Math.hypot(before[0] - other[0], before[1] - other[1]), Math.hypot(event.clientX - other[0], event.clientY - other[1])];
        this.view.zoom = clampZoom((this.view.zoom * is) / (was || 1));
      } else if (event.shiftKey || event.buttons === 2) move((1.4 * dx) / canvas.clientHeight, (1.4 * dy) / canvas.clientHeight);
      else turn(0.008 * dx, 0.008 * dy);
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
      changed();
    });
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => pointers.delete(event.pointerId));
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.view.zoom = clampZoom(this.view.zoom * Math.exp(-0.0015 * event.deltaY));
      changed();
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
      if (way && event.shiftKey) move(0.04 * way[0], 0.04 * way[1]);
      else if (way) turn(0.08 * way[0], 0.08 * way[1]);
      else if (event.key === "+" || event.key === "=") this.view.zoom = clampZoom(this.view.zoom * 1.15);
      else if (event.key === "-") this.view.zoom = clampZoom(this.view.zoom / 1.15);
      else if (event.key === "0") this.reset();
      else return;
      event.preventDefault();
      changed();
    });
  }
}

function clampZoom(zoom) {
  return Math.min(Math.max(zoom, 0.2), 60);
}

function segments() {
  return new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial());
}

function setSegments(part, list) {
  part.geometry.dispose();
  part.geometry = new THREE.BufferGeometry();
  part.geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(list), 3));
}

function pairs(points, lines) {
  const out = new Float32Array(3 * lines.length);
  lines.forEach((vertex, k) => out.set(points.subarray(3 * vertex, 3 * vertex + 3), 3 * k));
  return out;
}

const textures = new Map();

function markTexture({ colour, form }) {
  const key = colour + form;
  if (!textures.has(key)) {
    const canvas = h("canvas", { width: 32, height: 32 });
    const pen = canvas.getContext("2d");
    pen.fillStyle = colour;
    pen.strokeStyle = form === "ring" ? colour : "#ffffff";
    pen.lineWidth = form === "ring" ? 6 : 3;
    pen.beginPath();
    if (form === "square") pen.rect(5, 5, 22, 22);
    else if (form === "triangle") {
      pen.moveTo(3, 27);
      pen.lineTo(29, 27);
      pen.lineTo(16, 3);
      pen.closePath();
    } else pen.arc(16, 16, 11, 0, 2 * Math.PI);
    if (form !== "ring") pen.fill();
    pen.stroke();
    textures.set(key, new THREE.CanvasTexture(canvas));
  }
  return textures.get(key);
}
