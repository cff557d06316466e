// Bodies in three dimensions on pages of the site: turned by pointer and keys, deformed by a slider.
// <div class="figure-3d" data-body="NAME.json"><img ...></div>; without WebGL the image stays.

const STATES = { 0: "#ffffff", 1: "#56b4e9", 2: "#0072b2", 3: "#e69f00", 4: "#cc79a7" };
const here = new URL(".", import.meta.url);

/** Blue over grey to yellow: cividis at nine places. */
const MAP = [[0, 34, 78], [18, 53, 112], [59, 73, 108], [87, 93, 109], [112, 113, 115], [138, 134, 120], [165, 156, 116], [195, 179, 105], [225, 204, 85], [254, 232, 56]];

function colour(part) {
  const at = Math.min(Math.max(part, 0), 1) * (MAP.length - 1);
  const k = Math.min(Math.floor(at), MAP.length - 2);
  return MAP[k].map((low, c) => (low + (at - k) * (MAP[k + 1][c] - low)) / 255);
}

function part(tag, parent, attributes = {}, text = "") {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.textContent = text;
  parent.append(made);
  return made;
}

class Figure {
  constructor(THREE, host, body) {
    Object.assign(this, { THREE, host, body, shown: 0, scale: body.scale, yaw: -0.7, pitch: body.pitch ?? 0.35, zoom: 1 });
    this.canvas = document.createElement("canvas");
    this.renderer = new THREE.WebGLRenderer({ canvas: this.canvas, antialias: true, alpha: true });
    Object.assign(this.canvas, { tabIndex: 0 });
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `${body.title}. Drag or arrow keys turn it, plus and minus enlarge.`);
    host.replaceChildren(this.canvas);
    this.controls();
    this.scene = new THREE.Scene();
    this.camera = new THREE.OrthographicCamera();
    this.scene.add(new THREE.AmbientLight(0xffffff, 1.7));
    const light = new THREE.DirectionalLight(0xffffff, 1.3);
    light.position.set(-2, -3, 4);
    this.scene.add(light);
    this.geometry = new THREE.BufferGeometry();
    this.geometry.setIndex(body.triangles);
    this.geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(body.points), 3));
    this.geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(body.points.length), 3));
    const offset = { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 };
    const material = new THREE.MeshLambertMaterial({ vertexColors: true, side: THREE.DoubleSide, flatShading: true, ...offset });
    this.lines = new THREE.BufferGeometry();
    this.lines.setAttribute("position", this.geometry.getAttribute("position"));
    this.lines.setIndex(body.edges);
    const ink = new THREE.LineBasicMaterial({ color: 0x000000, transparent: true, opacity: 0.25 });
    this.marks = new THREE.BufferGeometry();
    const size = { size: 9, sizeAttenuation: false, vertexColors: true };
    this.scene.add(new THREE.Mesh(this.geometry, material), new THREE.LineSegments(this.lines, ink));
    this.scene.add(new THREE.Points(this.marks, new THREE.PointsMaterial(size)));
    const corners = body.ground.map((corner) => new THREE.Vector3(...corner));
    const foundation = new THREE.BufferGeometry().setFromPoints(corners);
    this.scene.add(new THREE.LineLoop(foundation, new THREE.LineBasicMaterial({ color: 0x5f5f5f })));
    const box = new THREE.Box3().setFromBufferAttribute(this.geometry.getAttribute("position"));
    this.centre = box.getCenter(new THREE.Vector3());
    this.radius = 0.46 * box.getSize(new THREE.Vector3()).length();
    this.turning();
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    this.update();
  }

  controls() {
    const bar = part("div", this.host, { class: "figure-3d-controls" });
    if (this.body.solutions.length > 1) {
      const group = part("span", bar, { role: "group", "aria-label": "solution" });
      this.buttons = this.body.solutions.map((one, k) => {
        const button = part("button", group, { type: "button" }, one.name);
        button.addEventListener("click", () => { this.shown = k; this.update(); });
        return button;
      });
    }
    const label = part("label", bar, {}, "deformation ");
    const slider = part("input", label, { type: "range", min: 0, max: 2 * this.body.scale, step: this.body.scale / 50, value: this.body.scale });
    slider.addEventListener("input", () => { this.scale = Number(slider.value); this.update(); });
    this.told = part("p", this.host, { class: "figure-3d-told" });
  }

  turning() {
    const turn = (x, y) => {
      this.yaw -= x;
      this.pitch = Math.min(Math.max(this.pitch + y, -1.55), 1.55);
      this.draw();
    };
    this.canvas.addEventListener("pointerdown", (event) => this.canvas.setPointerCapture(event.pointerId));
    this.canvas.addEventListener("pointermove", (event) => {
      if (event.buttons === 1) turn(0.008 * event.movementX, 0.008 * event.movementY);
    });
    this.canvas.addEventListener("keydown", (event) => {
      const ways = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] };
      if (event.key in ways) turn(...ways[event.key]);
      else if (event.key === "+" || event.key === "-") {
        this.zoom = Math.min(Math.max(this.zoom * (event.key === "+" ? 1.15 : 1 / 1.15), 0.5), 8);
        this.draw();
      } else return;
      event.preventDefault();
    });
  }

  update() {
    const { body, THREE, scale } = this;
    const one = body.solutions[this.shown];
    const place = this.geometry.getAttribute("position");
    const shade = this.geometry.getAttribute("color");
    for (let k = 0; k < body.points.length; k += 1) place.array[k] = body.points[k] + scale * one.displacement[k];
    one.stress.forEach((value, k) => shade.array.set(colour(value / body.most), 3 * k));
    place.needsUpdate = shade.needsUpdate = true;
    const at = Float32Array.from(body.contact.flatMap((node) => [...place.array.slice(3 * node, 3 * node + 3)]));
    for (let k = 2; k < at.length; k += 3) at[k] -= 0.004 * this.radius;
    this.marks.setAttribute("position", new THREE.BufferAttribute(at, 3));
    const shades = one.states.flatMap((state) => new THREE.Color(STATES[state]).toArray());
    this.marks.setAttribute("color", new THREE.BufferAttribute(Float32Array.from(shades), 3));
    this.buttons?.forEach((button, k) => button.setAttribute("aria-pressed", k === this.shown));
    const times = scale === 1 ? "" : `; displacement times ${scale.toPrecision(2)}`;
    this.told.textContent = `${one.told}${times}. Colour: von Mises stress, 0 to ${body.most.toPrecision(3)}; frame: surface of the foundation. Drag to turn.`;
    this.draw();
  }

  draw() {
    const { canvas, camera } = this;
    const [wide, tall] = [canvas.clientWidth, canvas.clientHeight];
    if (!wide || !tall) return;
    this.renderer.setPixelRatio(window.devicePixelRatio);
    this.renderer.setSize(wide, tall, false);
    const half = this.radius / this.zoom / Math.min(1, wide / tall);
    Object.assign(camera, { left: (-half * wide) / tall, right: (half * wide) / tall, top: half, bottom: -half, near: -100 * this.radius, far: 100 * this.radius });
    camera.up.set(0, 0, 1);
    const [c, s] = [Math.cos(this.pitch), Math.sin(this.pitch)];
    const away = new this.THREE.Vector3(c * Math.sin(this.yaw), -c * Math.cos(this.yaw), s);
    camera.position.copy(this.centre).addScaledVector(away, 10 * this.radius);
    camera.lookAt(this.centre);
    camera.updateProjectionMatrix();
    this.renderer.render(this.scene, camera);
  }
}

async function show(host) {
  try {
    const [THREE, answer] = await Promise.all([import(new URL("three.module.min.js", here)), fetch(new URL(host.dataset.body, here))]);
    THREE.ColorManagement.enabled = false;
    new Figure(THREE, host, await answer.json());
  } catch (error) {
    console.warn(`figure in three dimensions: ${error}`); // the image stays
  }
}

const watch = new IntersectionObserver((entries) => {
  for (const { isIntersecting, target } of entries) {
    if (!isIntersecting) continue;
    watch.unobserve(target);
    show(target);
  }
}, { rootMargin: "200px" });
for (const host of document.querySelectorAll(".figure-3d")) watch.observe(host);
