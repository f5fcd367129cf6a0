/**
 * The bodies, the hands, the tools and their forces in three dimensions, drawn by three.js with WebGL2. The scene is drawn only
 * when something changed. Lengths are in metres and z points up, as in the axes of the scene.
 */
import * as THREE from "three";
import { OrbitControls } from "./vendor/OrbitControls.js";
import { handColour, onTheme, property, SHAPES, table, viridis } from "./colours.js";
import { quantity, round125 } from "./format.js";

/** Ranges of colours end at such multiples of a power of ten. */
const ENDS = [1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10];
/** Time after which the picture stands still (ms). */
const STILL = 400;
/** Pixels of the drawing for each pixel of the page, in each direction, while WebGL on the processor draws motion. */
const COARSE = 0.75;
/** Least time between two changes of the labels while WebGL on the processor draws motion (ms). */
const LABELS = 100;
/** Most contacts of a frame. */
const CONTACTS = 256;
/** The size of the mark of an overlap (CSS pixels). */
const MARK = 7;
/** Most sites of all tools: eight tools, sixteen each. */
const SITES = 128;
/** The size of the mark of a site (CSS pixels). */
const SITE = 5;
const UNIT = { displacement: "m", stress: "Pa", overlaps: "m" };
const NAME = { displacement: "Displacement", stress: "Von Mises stress", overlaps: "Depth of contacts" };
const up = new THREE.Vector3(0, 0, 1);
const scratch = new THREE.Vector3();

/** The edges of triangles, each once. */
function edges(triangles) {
  const seen = new Set();
  const lines = [];
  for (let t = 0; t < triangles.length; t += 3) {
    for (let i = 0; i < 3; i += 1) {
      const [a, b] = [triangles[t + i], triangles[t + ((i + 1) % 3)]];
      const key = a < b ? a * 4294967296 + b : b * 4294967296 + a;
      if (!seen.has(key)) {
        seen.add(key);
        lines.push(a, b);
      }
    }
  }
  return new Uint32Array(lines);
}

/** Normals at the vertices: the sum over the triangles, weighted by area. */
function normals(positions, triangles, result) {
  result.fill(0);
  for (let t = 0; t < triangles.length; t += 3) {
    const a = 3 * triangles[t], b = 3 * triangles[t + 1], c = 3 * triangles[t + 2];
    const ux = positions[b] - positions[a], uy = positions[b + 1] - positions[a + 1], uz = positions[b + 2] - positions[a + 2];
    const vx = positions[c] - positions[a], vy = positions[c + 1] - positions[a + 1], vz = positions[c + 2] - positions[a + 2];
    const nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
    result[a] += nx; result[a + 1] += ny; result[a + 2] += nz;
    result[b] += nx; result[b + 1] += ny; result[b + 2] += nz;
    result[c] += nx; result[c + 1] += ny; result[c + 2] += nz;
  }
  for (let i = 0; i < result.length; i += 3) {
    const size = Math.hypot(result[i], result[i + 1], result[i + 2]) || 1;
    result[i] /= size; result[i + 1] /= size; result[i + 2] /= size;
  }
}

/** The view. `changed` is called after each drawing. */
export class View {
  constructor(canvas, labels) {
    this.canvas = canvas;
    this.labels = labels;
    this.changed = () => {};
    this.mode = "shaded";
    this.colour = "none";
    this.held = false;
    this.range = [0, 0];
    this.bodies = [];
    /** By body: the connectivity of an epoch whose vertices have not come. */
    this.next = [];
    this.hands = [];
    this.handles = [];
    this.obstacles = [];
    this.tools = [];
    /** The contacts of the last frame. */
    this.contacts = [];
    this.radius = 0.1;
    this.center = new THREE.Vector3();
    this.framed = false;
    this.newtons = 0;
    this.draws = 0;
    this.moved = -Infinity;
    this.mismatched = 0;
    this.software = isSoftware();
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !this.software, alpha: false, powerPreference: "low-power" });
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(32, 1, 0.001, 10);
    this.camera.up.copy(up);
    this.camera.position.set(0.12, -0.3, 0.2);
    this.sky = new THREE.HemisphereLight(0xffffff, 0xb0b0b0, 1.6);
    this.sky.position.copy(up);
    this.lamp = new THREE.DirectionalLight(0xffffff, 1.6);
    this.camera.add(this.lamp);
    this.lamp.position.set(-0.6, 0.9, 1);
    this.scene.add(this.sky, this.camera);
    this.grid = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ transparent: true }));
    this.axes = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial());
    this.scene.add(this.grid, this.axes);
    this.pushes = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ depthTest: false }));
    this.pushes.geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(6 * CONTACTS), 3).setUsage(THREE.DynamicDrawUsage));
    this.pushes.frustumCulled = false;
    this.pushes.visible = false;
    this.scene.add(this.pushes);
    this.overlaps = new THREE.Points(new THREE.BufferGeometry(), new THREE.PointsMaterial({ size: MARK, sizeAttenuation: false, vertexColors: true, depthTest: false }));
    for (const name of ["position", "color"]) {
      this.overlaps.geometry.setAttribute(name, new THREE.BufferAttribute(new Float32Array(3 * CONTACTS), 3).setUsage(THREE.DynamicDrawUsage));
    }
    this.overlaps.frustumCulled = false;
    // Contacts are drawn last, so that no body hides them.
    this.pushes.renderOrder = this.overlaps.renderOrder = 1;
    this.scene.add(this.overlaps);
    // The points of the surfaces among which the tick looks for contacts of the tools.
    this.sites = new THREE.Points(new THREE.BufferGeometry(), new THREE.PointsMaterial({ size: SITE, sizeAttenuation: false, vertexColors: true, depthTest: false }));
    for (const name of ["position", "color"]) {
      this.sites.geometry.setAttribute(name, new THREE.BufferAttribute(new Float32Array(3 * SITES), 3).setUsage(THREE.DynamicDrawUsage));
    }
    this.sites.frustumCulled = false;
    this.sites.renderOrder = 1;
    this.scene.add(this.sites);
    this.map = new THREE.DataTexture(new Uint8Array(table().buffer), 256, 1);
    this.map.colorSpace = THREE.SRGBColorSpace;
    this.map.minFilter = THREE.LinearFilter;
    this.map.magFilter = THREE.LinearFilter;
    this.map.needsUpdate = true;
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", () => this.request());
    this.labelled = new Map();
    this.ball = new THREE.SphereGeometry(1, 24, 16);
    this.shaft = new THREE.CylinderGeometry(1, 1, 1, 12).rotateX(Math.PI / 2).translate(0, 0, 0.5);
    this.tip = new THREE.ConeGeometry(1, 1, 16).rotateX(Math.PI / 2).translate(0, 0, 0.5);
    this.mark = new THREE.OctahedronGeometry(1);
    new ResizeObserver(() => this.request()).observe(canvas.parentElement);
    onTheme(() => this.restyle());
    canvas.addEventListener("webglcontextrestored", () => this.request());
  }

  /** Begins a run or a log: the names of its devices and bodies. */
  begin(hello) {
    this.hello = hello;
    for (const body of this.bodies) this.remove(body);
    this.bodies = [];
    this.next = [];
    this.framed = false;
    this.newtons = 0;
    for (const { group } of this.hands) this.scene.remove(group);
    for (const { mesh } of this.handles) this.scene.remove(mesh);
    for (const label of this.labelled.values()) label.remove();
    this.labelled.clear();
    for (const { group } of this.tools) this.scene.remove(group);
    for (const { mesh } of this.obstacles) {
      this.scene.remove(mesh);
      mesh.geometry.dispose();
    }
    this.obstacles = (hello.obstacles ?? []).map((info) => this.obstacle(info));
    this.tools = (hello.tools ?? []).map((info) => this.tool(info));
    this.contacts = [];
    this.hands = hello.devices.map((info, device) => this.hand(info, device));
    this.handles = hello.bodies.flatMap((body, index) => body.handles.map((info) => {
      const material = new THREE.MeshLambertMaterial();
      const mesh = new THREE.Mesh(this.mark, material);
      mesh.position.fromArray(info.origin);
      this.scene.add(mesh);
      return { body: index, info, mesh, vertex: -1 };
    }));
    this.restyle();
  }

  /** An obstacle in its own axes, hidden until a frame has its pose. */
  obstacle(info) {
    const geometry = new THREE.BufferGeometry();
    const position = new THREE.BufferAttribute(new Float32Array(info.positions), 3);
    const normal = new THREE.BufferAttribute(new Float32Array(info.positions.length), 3);
    geometry.setAttribute("position", position);
    geometry.setAttribute("normal", normal);
    geometry.setIndex(new THREE.BufferAttribute(new Uint32Array(info.triangles), 1));
    normals(position.array, info.triangles, normal.array);
    const mesh = new THREE.Mesh(geometry, new THREE.MeshLambertMaterial({ side: THREE.DoubleSide }));
    mesh.frustumCulled = false;
    mesh.visible = false;
    this.scene.add(mesh);
    return { info, mesh, position, normal };
  }

  /** Moves an obstacle; `positions` only if its vertices move in its axes. */
  place({ info, mesh, position, normal }, { pose, positions }) {
    mesh.visible = true;
    mesh.position.set(pose[0], pose[1], pose[2]);
    mesh.quaternion.set(pose[3], pose[4], pose[5], pose[6]);
    if (positions?.length !== position.array.length) return;
    position.array.set(positions);
    normals(position.array, info.triangles, normal.array);
    position.needsUpdate = normal.needsUpdate = true;
  }

  hand(info, device) {
    const { part, material, faint } = marked();
    const ball = part(this.ball);
    const arrow = this.arrow(part);
    const group = new THREE.Group();
    group.add(ball, arrow.group);
    group.visible = false;
    this.scene.add(group);
    return { info, device, group, ball, arrow, material, faint };
  }

  /** An arrow from the origin of its group. */
  arrow(part) {
    const [shaft, tip] = [part(this.shaft), part(this.tip)];
    const group = new THREE.Group();
    group.add(shaft, tip);
    group.visible = false;
    return { group, shaft, tip };
  }

  /** Points an arrow along a force (N), for hands of this size (m). */
  point({ group, shaft, tip }, force, size) {
    const direction = scratch.fromArray(force);
    const length = direction.length() * this.newtons;
    group.visible = length > 0.5 * size;
    if (!group.visible) return;
    group.quaternion.setFromUnitVectors(up, direction.normalize());
    const head = Math.min(3.2 * size, 0.6 * length);
    shaft.scale.set(0.32 * size, 0.32 * size, length - head);
    tip.scale.set(0.9 * size, 0.9 * size, head);
    tip.position.z = length - head;
  }

  /** A tool, beside its obstacle: its ghost where its device would lead it, a line from there to the tool, and the force of the surface. */
  tool(info) {
    const { part, material, faint } = marked();
    const arrow = this.arrow(part);
    const ghost = new THREE.Mesh(this.obstacles[info.obstacle]?.mesh.geometry, new THREE.MeshLambertMaterial({ transparent: true, opacity: 0.3, depthWrite: false }));
    ghost.frustumCulled = false;
    const line = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ depthTest: false }));
    line.geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(6), 3).setUsage(THREE.DynamicDrawUsage));
    line.frustumCulled = false;
    line.renderOrder = ghost.renderOrder = 1;
    const group = new THREE.Group();
    group.add(arrow.group, ghost, line);
    group.visible = false;
    this.scene.add(group);
    return { info, group, arrow, ghost, line, material, faint };
  }

  remove(body) {
    if (!body) return;
    this.scene.remove(body.mesh, body.wire);
    body.geometry.dispose();
    body.wire.geometry.dispose();
  }

  /** Takes the connectivity of a body. A body in motion is drawn as before until the vertices of the new epoch come. */
  surface(surface) {
    if (this.bodies[surface.body]?.shown) this.next[surface.body] = surface;
    else this.put(surface);
  }

  /** Draws a body with this connectivity, at rest until the next frame. */
  put(surface) {
    delete this.next[surface.body];
    this.remove(this.bodies[surface.body]);
    const position = new THREE.BufferAttribute(new Float32Array(surface.rest), 3).setUsage(THREE.DynamicDrawUsage);
    const normal = new THREE.BufferAttribute(new Float32Array(3 * surface.vertices), 3).setUsage(THREE.DynamicDrawUsage);
    const uv = new THREE.BufferAttribute(new Float32Array(2 * surface.vertices).fill(0.5), 2).setUsage(THREE.DynamicDrawUsage);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", position);
    geometry.setAttribute("normal", normal);
    geometry.setAttribute("uv", uv);
    geometry.setIndex(new THREE.BufferAttribute(new Uint32Array(surface.triangles), 1));
    const lines = new THREE.BufferGeometry();
    lines.setAttribute("position", position);
    lines.setAttribute("uv", uv);
    const isThread = surface.triangle_count === 0;
    lines.setIndex(new THREE.BufferAttribute(isThread ? new Uint32Array(surface.lines) : edges(surface.triangles), 1));
    const mesh = new THREE.Mesh(geometry, new THREE.MeshLambertMaterial({
      side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
    }));
    const wire = new THREE.LineSegments(lines, new THREE.LineBasicMaterial({ transparent: true }));
    mesh.frustumCulled = false;
    wire.frustumCulled = false;
    this.scene.add(mesh, wire);
    const body = { surface, geometry, mesh, wire, position, normal, uv, isThread, stress: null, stale: true, shown: null };
    this.bodies[surface.body] = body;
    for (const handle of this.handles) {
      if (handle.body === surface.body) handle.vertex = nearest(surface.rest, handle.info.origin);
    }
    this.restyle();
  }

  /** Takes a frame. */
  frame(frame) {
    frame.bodies.forEach(({ vertices }, index) => {
      if (vertices && this.next[index]?.epoch === vertices.epoch) this.put(this.next[index]);
      const body = this.bodies[index];
      if (!vertices || !body) return;
      if (vertices.epoch !== body.surface.epoch || vertices.count !== body.surface.vertices) {
        this.mismatched += 1;
        return;
      }
      body.position.array = vertices.positions;
      body.position.needsUpdate = true;
      body.stress = vertices.stress;
      body.stale = true;
      body.shown = { step: vertices.step, time_ns: vertices.time_ns, epoch: vertices.epoch };
    });
    frame.hands.forEach((hand, device) => {
      if (this.hands[device]) this.hands[device].state = hand;
    });
    frame.obstacles?.forEach((state, index) => {
      if (this.obstacles[index]) this.place(this.obstacles[index], state);
    });
    for (const state of frame.tools ?? []) {
      const tool = this.tools.find(({ info }) => info.device === state.device);
      if (tool) tool.state = state;
    }
    this.contacts = frame.contacts ?? [];
    if (!this.framed && frame.hands.length > 0) this.reset();
    this.request();
  }

  /** Shows or hides the forces of contacts. */
  setContacts(shown) {
    this.pushes.visible = shown;
    this.request();
  }

  setMode(mode) {
    this.mode = mode;
    this.restyle();
  }

  setColour(colour) {
    this.colour = colour;
    this.range = [0, 0];
    this.restyle();
  }

  setHold(held) {
    this.held = held;
    this.recolour();
  }

  /** Whether the bodies are coloured: a quantity is chosen, and the frames have it. */
  get coloured() {
    if (this.colour === "stress") return this.bodies.some((body) => body?.stress);
    return this.colour !== "none" && this.colour !== "overlaps";
  }

  recolour() {
    for (const body of this.bodies) if (body) body.stale = true;
    this.request();
  }

  restyle() {
    const background = new THREE.Color(property("--view"));
    this.renderer.setClearColor(background);
    const coloured = this.coloured;
    this.overlaps.visible = this.colour === "overlaps";
    for (const body of this.bodies) {
      if (!body) continue;
      body.mesh.visible = this.mode !== "wire" && !body.isThread;
      body.wire.visible = this.mode !== "shaded" || body.isThread;
      const wireColoured = coloured && (this.mode === "wire" || body.isThread);
      style(body.mesh.material, coloured ? this.map : null, coloured ? "#ffffff" : property("--body"));
      style(body.wire.material, wireColoured ? this.map : null, wireColoured ? "#ffffff" : property(this.mode === "both" ? "--wire-over" : "--wire"));
      body.wire.material.opacity = this.mode === "both" ? 0.45 : 1;
    }
    // A coloured surface is lit more evenly, so that its colours can be compared with the bar.
    this.sky.intensity = coloured ? 2.6 : 1.6;
    this.lamp.intensity = coloured ? 0.7 : 1.7;
    this.hands.forEach(({ material, faint }, device) => {
      material.color.set(handColour(device));
      faint.color.set(handColour(device));
    });
    for (const { mesh, info } of this.handles) mesh.material.color.set(handColour(info.device));
    for (const { info, ghost, line, material, faint } of this.tools) {
      for (const each of [ghost.material, line.material, material, faint]) each.color.set(handColour(info.device));
    }
    for (const { mesh } of this.obstacles) mesh.material.color.set(property("--grid"));
    this.pushes.material.color.set(property("--axis"));
    this.grid.material.color.set(property("--grid"));
    this.axes.material.color.set(property("--axis"));
    this.recolour();
  }

  /** Shows everything, from the direction of a number: 0 oblique, 1 the front, 2 the side, 3 above. */
  reset(from = 0) {
    const box = new THREE.Box3();
    for (const body of this.bodies) {
      if (!body) continue;
      const { array } = body.position;
      const used = body.isThread ? body.surface.lines : body.surface.triangles;
      for (const vertex of used) box.expandByPoint(scratch.fromArray(array, 3 * vertex));
    }
    for (const { info, mesh, position } of this.obstacles) {
      // A plane is larger than what the picture has to show.
      if (info.shape === "plane" || !mesh.visible) continue;
      mesh.updateMatrix();
      for (let i = 0; i < position.count; i += 1) {
        box.expandByPoint(scratch.fromBufferAttribute(position, i).applyMatrix4(mesh.matrix));
      }
    }
    for (const { state } of this.hands) if (state) box.expandByPoint(scratch.fromArray(state.position));
    for (const { info } of this.handles) box.expandByPoint(scratch.fromArray(info.origin));
    if (box.isEmpty()) box.set(new THREE.Vector3(-0.05, -0.05, -0.05), new THREE.Vector3(0.05, 0.05, 0.05));
    this.framed = true;
    box.getCenter(this.center);
    this.radius = Math.max(box.getSize(scratch).length() / 2, 0.005);
    const directions = [[0.45, -1, 0.62], [0, -1, 0.0001], [1, 0, 0.0001], [0, -0.0001, 1]];
    this.layGrid(box);
    this.camera.position.fromArray(directions[from]).normalize().add(this.center);
    this.camera.lookAt(this.center);
    // The axes belong to what is seen.
    for (const end of this.axisEnds) box.expandByPoint(end);
    const distance = this.distance(corners(box));
    this.camera.position.sub(this.center).multiplyScalar(distance).add(this.center);
    this.controls.target.copy(this.center);
    this.camera.near = distance / 100;
    this.camera.far = distance * 20;
    this.camera.updateProjectionMatrix();
    this.controls.minDistance = this.radius / 10;
    this.controls.maxDistance = this.radius * 30;
    this.controls.update();
    this.request();
  }

  /** The distance from the center at which a camera that looks there shows all points, with a margin. */
  distance(points) {
    this.camera.updateMatrix();
    const [right, up, back] = [0, 1, 2].map((column) => new THREE.Vector3().setFromMatrixColumn(this.camera.matrix, column));
    const rise = 0.85 * Math.tan((this.camera.fov * Math.PI) / 360);
    const far = points.map((point) => {
      scratch.copy(point).sub(this.center);
      const across = Math.abs(scratch.dot(right)) / (rise * this.camera.aspect);
      return scratch.dot(back) + Math.max(across, Math.abs(scratch.dot(up)) / rise);
    });
    return Math.max(...far);
  }

  /** A grid below everything, with cells of a round length, and the three axes at its corner. */
  layGrid(box) {
    const cell = round125(this.radius / 2.2);
    const low = Math.floor((box.min.z - 0.15 * this.radius) / cell) * cell;
    const [x0, x1] = [Math.floor(box.min.x / cell) * cell, Math.ceil(box.max.x / cell) * cell];
    const [y0, y1] = [Math.floor(box.min.y / cell) * cell, Math.ceil(box.max.y / cell) * cell];
    const points = [];
    for (let x = x0; x <= x1 + cell / 2; x += cell) points.push(x, y0, low, x, y1, low);
    for (let y = y0; y <= y1 + cell / 2; y += cell) points.push(x0, y, low, x1, y, low);
    this.grid.geometry.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
    this.grid.geometry.computeBoundingSphere();
    // The axes are a little above the grid, so that both are visible.
    const z = low + 0.004 * this.radius;
    const corner = [x0, y0, z];
    const ends = [[x0 + cell, y0, z], [x0, y0 + cell, z], [x0, y0, z + cell]];
    this.axes.geometry.setAttribute("position", new THREE.Float32BufferAttribute(ends.flatMap((end) => [...corner, ...end]), 3));
    this.axes.geometry.computeBoundingSphere();
    this.cell = cell;
    this.axisEnds = ends.map((end) => new THREE.Vector3(...end));
  }

  /** Turns the view by angles (rad), moves it by fractions of its height, or zooms. */
  move({ turn = 0, tilt = 0, right = 0, rise = 0, zoom = 1 }) {
    const offset = this.camera.position.clone().sub(this.controls.target);
    const size = offset.length();
    const polar = new THREE.Spherical().setFromVector3(new THREE.Vector3(offset.x, offset.z, -offset.y));
    polar.theta += turn;
    polar.phi = Math.min(Math.max(polar.phi + tilt, 0.01), Math.PI - 0.01);
    polar.radius = Math.min(Math.max(size * zoom, this.controls.minDistance), this.controls.maxDistance);
    const turned = new THREE.Vector3().setFromSpherical(polar);
    const height = 2 * size * Math.tan((this.camera.fov * Math.PI) / 360);
    const across = new THREE.Vector3().setFromMatrixColumn(this.camera.matrix, 0).multiplyScalar(right * height);
    across.addScaledVector(scratch.setFromMatrixColumn(this.camera.matrix, 1), rise * height);
    this.controls.target.add(across);
    this.camera.position.set(turned.x, -turned.z, turned.y).add(this.controls.target);
    this.controls.update();
    this.request();
  }

  /** Asks for a drawing before the next repaint of the screen. */
  request(moved = true) {
    if (moved) {
      this.moved = performance.now();
      if (this.software) {
        clearTimeout(this.settling);
        this.settling = setTimeout(() => this.request(false), STILL + 50);
      }
    }
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => this.draw());
  }

  /** Draws at once. */
  draw() {
    this.asked = false;
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (width === 0 || height === 0) return;
    const still = this.software && performance.now() - this.moved > STILL;
    const ratio = Math.min(devicePixelRatio, 2) * (still ? 2 : this.software ? COARSE : 1);
    if (this.width !== width || this.height !== height || this.ratio !== ratio) {
      [this.width, this.height, this.ratio] = [width, height, ratio];
      this.rem = getComputedStyle(document.documentElement).fontSize;
      this.renderer.setPixelRatio(ratio);
      this.renderer.setSize(width, height, false);
      this.camera.aspect = width / height;
      this.camera.updateProjectionMatrix();
      if (this.framed && this.draws < 3) this.reset();
    }
    this.updateBodies();
    this.updateHands();
    this.updateTools();
    if (this.pushes.visible) this.updateContacts();
    if (this.overlaps.visible) this.updateOverlaps();
    this.renderer.render(this.scene, this.camera);
    this.draws += 1;
    const now = performance.now();
    if (!this.software || still || now - (this.labelsPlaced ?? -Infinity) >= LABELS) {
      this.labelsPlaced = now;
      this.placeLabels();
    }
    this.changed();
  }

  updateBodies() {
    const { coloured } = this;
    if (coloured !== this.wasColoured) {
      this.wasColoured = coloured;
      this.restyle();
    }
    let most = 0;
    for (const body of this.bodies) {
      if (!body?.stale) continue;
      body.stale = false;
      if (!body.isThread) {
        normals(body.position.array, body.surface.triangles, body.normal.array);
        body.normal.needsUpdate = true;
      }
      if (coloured) body.values = this.values(body);
    }
    if (!coloured) return;
    for (const { values } of this.bodies.filter(Boolean)) {
      for (const value of values ?? []) if (value > most) most = value;
    }
    const scale = this.fit(most);
    for (const body of this.bodies.filter(Boolean)) {
      const uv = body.uv.array;
      for (let i = 0; i < body.surface.vertices; i += 1) {
        const value = Math.min(Math.max((body.values?.[i] ?? 0) * scale, 0), 1);
        // The centres of the first and the last pixel of the map.
        uv[2 * i] = (value * 255 + 0.5) / 256;
      }
      body.uv.needsUpdate = true;
    }
  }

  /** Fits the range of the colours to the largest value. Returns the factor from a value to a place in the range. */
  fit(most) {
    if (!this.held && (most > this.range[1] || most < 0.55 * this.range[1])) this.range = [0, end(most)];
    return this.range[1] > 0 ? 1 / this.range[1] : 0;
  }

  /** The quantity that is shown in colour, by vertex. */
  values(body) {
    if (this.colour === "stress") return body.stress;
    // The golden ratio takes clusters that follow each other to colours far apart.
    if (this.colour === "clusters") {
      return Float32Array.from(this.hello.bodies[body.surface.body].clusters ?? [], (cluster) => (0.618034 * (cluster + 1)) % 1);
    }
    const { rest, vertices } = body.surface;
    const { array } = body.position;
    const values = new Float32Array(vertices);
    for (let i = 0; i < vertices; i += 1) {
      values[i] = Math.hypot(array[3 * i] - rest[3 * i], array[3 * i + 1] - rest[3 * i + 1], array[3 * i + 2] - rest[3 * i + 2]);
    }
    return values;
  }

  updateHands() {
    const size = 0.032 * this.radius;
    let most = 0;
    for (const { state } of [...this.hands, ...this.tools]) if (state) most = Math.max(most, Math.hypot(...state.force));
    // Metres of arrow for a newton, in round numbers. The scale changes only when the arrows no longer fit.
    if (most > 0.05 && (this.newtons === 0 || most * this.newtons > 0.7 * this.radius)) {
      this.newtons = round125((0.4 * this.radius) / most);
    }
    for (const hand of this.hands) {
      const { state, group, ball, arrow, material } = hand;
      if (!state) continue;
      group.visible = true;
      group.position.fromArray(state.position);
      ball.scale.setScalar(size);
      // A device that is silent is shown as a wire.
      material.wireframe = !state.fresh;
      this.point(arrow, state.force, size);
    }
    for (const { body, mesh, vertex } of this.handles) {
      mesh.scale.setScalar(0.7 * size);
      if (vertex >= 0) mesh.position.fromArray(this.bodies[body].position.array, 3 * vertex);
    }
  }

  updateTools() {
    const { position, color } = this.sites.geometry.attributes;
    let shown = 0;
    for (const { info, state, group, arrow, ghost, line } of this.tools) {
      const at = this.obstacles[info.obstacle]?.mesh;
      if (!state || !at) continue;
      group.visible = true;
      const [x, y, z, ...turn] = state.led;
      ghost.position.set(x, y, z);
      ghost.quaternion.set(...turn);
      line.geometry.attributes.position.array.set([x, y, z, ...at.position.toArray()]);
      line.geometry.attributes.position.needsUpdate = true;
      arrow.group.position.copy(at.position);
      this.point(arrow, state.force, 0.032 * this.radius);
      const rgb = line.material.color.toArray();
      for (const site of (state.sites ?? []).slice(0, SITES - shown)) {
        position.array.set(site, 3 * shown);
        color.array.set(rgb, 3 * shown);
        shown += 1;
      }
    }
    position.needsUpdate = color.needsUpdate = true;
    this.sites.geometry.setDrawRange(0, shown);
  }

  /** Lines along the forces of contacts: the largest is a third of the radius long. */
  updateContacts() {
    const most = Math.max(1e-9, ...this.contacts.map(({ force }) => Math.hypot(...force)));
    const scale = this.radius / (3 * most);
    const { position } = this.pushes.geometry.attributes;
    const shown = this.contacts.slice(0, CONTACTS);
    shown.forEach(({ at, force }, index) => position.array.set([...at, ...at.map((x, axis) => x + scale * force[axis])], 6 * index));
    position.needsUpdate = true;
    this.pushes.geometry.setDrawRange(0, 2 * shown.length);
  }

  /** Marks at the contacts, in the colour of their depth. */
  updateOverlaps() {
    const shown = this.contacts.slice(0, CONTACTS);
    const scale = this.fit(Math.max(0, ...shown.map(({ depth }) => depth)));
    const { position, color } = this.overlaps.geometry.attributes;
    shown.forEach(({ at, depth }, index) => {
      const rgb = viridis(depth * scale).map((part) => part / 255);
      position.array.set(at, 3 * index);
      color.array.set(new THREE.Color().setRGB(...rgb, THREE.SRGBColorSpace).toArray(), 3 * index);
    });
    position.needsUpdate = color.needsUpdate = true;
    this.overlaps.geometry.setDrawRange(0, shown.length);
  }

  /** The position of a point (m) on the canvas, in CSS pixels from its left upper corner. */
  project(point) {
    scratch.set(point[0], point[1], point[2]).project(this.camera);
    return [(scratch.x + 1) * 0.5 * this.width, (1 - scratch.y) * 0.5 * this.height, scratch.z];
  }

  placeLabels() {
    const place = (key, text, point, colour, above = false) => {
      let label = this.labelled.get(key);
      if (!label) {
        label = document.createElement("span");
        label.className = key.startsWith("axis") ? "axis" : "hand";
        this.labels.append(label);
        this.labelled.set(key, label);
      }
      if (label.textContent !== text) label.textContent = text;
      const [x, y, depth] = this.project(point);
      label.hidden = depth > 1 || x < 0 || y < 0 || x > this.width || y > this.height;
      // At the right border the label is to the left of its point.
      const left = colour && x > this.width - 13 * parseFloat(this.rem ?? 13) ? " translateX(calc(-100% - 1.5rem))" : "";
      const rise = above ? " translateY(calc(-100% - 1.1rem))" : "";
      label.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)${left}${rise}`;
      if (colour && label.dataset.colour !== colour) {
        label.dataset.colour = colour;
        label.style.setProperty("--colour", colour);
      }
    };
    this.hands.forEach((hand, device) => {
      const { info, state } = hand;
      if (!state) return;
      // The label is below the hand, and above if the arrow points down, so that the arrow stays visible. Near the
      // horizontal the label keeps its side.
      const tip = state.position.map((x, axis) => x + state.force[axis] * this.newtons);
      const down = this.project(tip)[1] - this.project(state.position)[1];
      if (Math.abs(down) > 4) hand.labelAbove = down > 0;
      const force = Math.hypot(...state.force).toFixed(2);
      place(`hand${device}`, `${SHAPES[device]} ${info.name} ${force} N`, state.position, handColour(device), hand.labelAbove);
    });
    this.axisEnds?.forEach((point, axis) => place(`axis${axis}`, "xyz"[axis], point.toArray()));
  }

  /** The lengths and scales of the picture, in words. */
  legend() {
    const parts = this.cell ? [`Grid ${quantity(this.cell, "m", 2)}`] : [];
    if (this.newtons > 0) parts.push(`Arrows ${quantity(this.newtons, "m", 2)} for 1 N`);
    return parts.join(" · ");
  }

  /** Facts of the colour bar; `null` without colours. */
  bar() {
    if (this.colour === "none" || this.colour === "clusters") return null;
    const [low, high] = this.range;
    return {
      name: NAME[this.colour],
      ticks: scale([0, 0.25, 0.5, 0.75, 1].map((t) => low + t * (high - low)), UNIT[this.colour]),
      empty: !this.coloured && this.colour !== "overlaps",
    };
  }

  /** Draws, and reads the pixels of the canvas (red, green, blue, alpha), from the left lower corner. */
  readPixels() {
    this.draw();
    const gl = this.renderer.getContext();
    const [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
    const pixels = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    return { width, height, pixels };
  }

  /** Saves the view as PNG. */
  save(name) {
    this.moved = -Infinity;
    this.draw();
    this.canvas.toBlob((blob) => {
      if (!blob) return;
      const anchor = document.createElement("a");
      anchor.href = URL.createObjectURL(blob);
      anchor.download = name;
      anchor.click();
      setTimeout(() => URL.revokeObjectURL(anchor.href), 10000);
    }, "image/png");
  }
}

/** A material, and what makes parts of it: what a body hides is drawn again, fainter, so that hands and forces are always visible. */
function marked() {
  const material = new THREE.MeshPhongMaterial({ shininess: 40, specular: 0x222222 });
  const faint = new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.4, depthFunc: THREE.GreaterDepth, depthWrite: false });
  const part = (geometry) => {
    const mesh = new THREE.Mesh(geometry, material);
    const hidden = new THREE.Mesh(geometry, faint);
    hidden.renderOrder = 1;
    mesh.add(hidden);
    return mesh;
  };
  return { part, material, faint };
}

function style(material, map, colour) {
  if (material.map !== map) {
    material.map = map;
    material.needsUpdate = true;
  }
  material.color.set(colour);
}

/**
 * Whether WebGL runs on the processor. There, smooth edges cost half of the rate: they are then drawn only while the
 * picture stands still, by more pixels.
 */
function isSoftware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const info = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

/** A round number that is at least `value`. */
function end(value) {
  if (!(value > 0)) return 0;
  const power = 10 ** Math.floor(Math.log10(value));
  return (ENDS.find((step) => step * power >= value) ?? 10) * power;
}

/** Quantities in the prefix of the last, which is the largest and has the unit. */
function scale(values, unit) {
  const [, number, prefixed] = /^(\S+) (.*)$/.exec(quantity(values.at(-1), unit)) ?? [null, "0", unit];
  const factor = values.at(-1) > 0 ? Number(number) / values.at(-1) : 1;
  return values.map((value, i) => `${Number((value * factor).toPrecision(3))}${i === values.length - 1 ? ` ${prefixed}` : ""}`);
}

/** The eight corners of a box. */
function corners({ min, max }) {
  return [min, max].flatMap(({ x }) => [min, max].flatMap(({ y }) => [min, max].map(({ z }) => new THREE.Vector3(x, y, z))));
}

/** The vertex nearest to a point. */
function nearest(rest, point) {
  let [best, least] = [-1, Infinity];
  for (let i = 0; i < rest.length; i += 3) {
    const distance = Math.hypot(rest[i] - point[0], rest[i + 1] - point[1], rest[i + 2] - point[2]);
    if (distance < least) [best, least] = [i / 3, distance];
  }
  return best;
}
