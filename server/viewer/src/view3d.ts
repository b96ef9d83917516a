// The surface in space: panels, mesh, supports, faults, boundary vertices, labels.
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { Problem, Result, Vec3 } from "./api";
import { FeatureLines } from "./features";
import { PolygonLayer, reshape } from "./polygons";

export interface Toggles {
  edges: boolean;
  labels: boolean;
  normals: boolean;
  supports: boolean;
  mesh: boolean;
  features: boolean;
}

const MAX_LABELS = 120;
/** What lies over the view and hides what is under it. */
const OVERLAYS = ".bar, #legend";

export class View3D {
  readonly renderer: THREE.WebGLRenderer;
  readonly camera = new THREE.PerspectiveCamera(35, 1, 0.01, 1000);
  readonly controls: OrbitControls;
  private readonly scene = new THREE.Scene();
  private readonly content = new THREE.Group();
  private readonly headlight = new THREE.DirectionalLight(0xffffff, 1.5);
  private readonly section = new THREE.Plane(new THREE.Vector3(0, 0, -1), Infinity);
  private readonly labels: HTMLElement;
  private readonly layer = new PolygonLayer(true);
  private readonly normals = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: 0xd9622b }));
  private readonly supports = new THREE.Mesh(new THREE.BufferGeometry(), new THREE.MeshLambertMaterial({ color: 0x5b4a3f, side: THREE.DoubleSide }));
  private mesh: THREE.Object3D | null = null;
  private boundary: THREE.Points | null = null;
  private cones: THREE.Points | null = null;
  private solid: THREE.Mesh | null = null;
  /** Of the result: what is drawn of it stays while it is the same. For rays, made into a solid when the first one is sent. */
  private sheet: Result["mesh"] | null = null;
  /** Creases and drawn lines, and the line that is being drawn. */
  private features: FeatureLines | null = null;
  private sketch: THREE.Object3D | null = null;
  /** Called when singularity i was dragged to another point of the surface. */
  onDrag: ((i: number, to: Vec3) => void) | null = null;
  private labelText: { text: string[]; centers: Vec3[]; normals: Vec3[] } | null = null;
  private shown: Toggles = { edges: true, labels: false, normals: false, supports: false, mesh: false, features: true };
  private box = new THREE.Box3(new THREE.Vector3(-1, -1, -1), new THREE.Vector3(1, 1, 1));
  private origin = new THREE.Vector3();
  private next = 0;

  constructor(readonly element: HTMLElement) {
    this.renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true, preserveDrawingBuffer: false });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.clippingPlanes = [];
    const canvas = this.renderer.domElement;
    canvas.tabIndex = 0;
    canvas.setAttribute("aria-label", "Panels in space. Arrow keys turn, plus and minus zoom, F fits, brackets step through panels.");
    element.prepend(canvas);
    this.labels = document.createElement("div");
    this.labels.className = "labels";
    element.append(this.labels);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = true;
    this.controls.dampingFactor = 0.12;
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("change", () => this.invalidate());
    this.controls.addEventListener("start", () => (this.fitted = false));
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x9aa0a4, 2.1), this.content, this.layer.group, this.normals, this.supports, this.camera);
    this.headlight.position.set(0.5, 0.8, 1);
    this.camera.add(this.headlight);
    const observer = new ResizeObserver(() => this.resize());
    for (const one of [element, ...element.querySelectorAll(OVERLAYS)]) observer.observe(one);
    canvas.addEventListener("keydown", (event) => this.key(event));
    // In the capturing phase, before the controls begin to turn the camera.
    canvas.addEventListener("pointerdown", (event) => this.grab(event), { capture: true });
    this.resize();
    this.invalidate();
  }

  /** Draws in the next frame, and in those after it until the controls have come to rest; a still picture costs nothing. */
  invalidate(): void {
    this.next ||= requestAnimationFrame(() => {
      this.next = 0;
      this.controls.update();
      this.render();
    });
  }

  /** Draws now; public so that a frame can be timed. */
  render(): void {
    this.renderer.render(this.scene, this.camera);
    this.placeLabels();
  }

  /** Nobody has turned or moved the model since: it then goes with the window. */
  private fitted = false;

  private resize(): void {
    const { clientWidth: w, clientHeight: h } = this.element;
    if (!w || !h) return;
    this.renderer.setSize(w, h);
    this.camera.aspect = w / h;
    const view = this.camera.view;
    if (view) this.camera.setViewOffset(w, h, (view.offsetX / view.fullWidth) * w, (view.offsetY / view.fullHeight) * h, w, h);
    this.camera.updateProjectionMatrix();
    if (this.fitted) this.fit();
    this.render();
  }

  private key(event: KeyboardEvent): void {
    this.fitted = false;
    const turn = 0.12;
    const offset = this.camera.position.clone().sub(this.controls.target);
    if (event.key === "ArrowLeft" || event.key === "ArrowRight")
      offset.applyAxisAngle(new THREE.Vector3(0, 0, 1), event.key === "ArrowLeft" ? -turn : turn);
    else if (event.key === "ArrowUp" || event.key === "ArrowDown") {
      const polar = Math.acos(THREE.MathUtils.clamp(offset.z / offset.length(), -1, 1));
      const next = THREE.MathUtils.clamp(polar + (event.key === "ArrowUp" ? -turn : turn), 0.02, Math.PI - 0.02);
      const axis = new THREE.Vector3(-offset.y, offset.x, 0).normalize();
      offset.applyAxisAngle(axis, next - polar);
    } else if (event.key === "+" || event.key === "=") offset.multiplyScalar(0.88);
    else if (event.key === "-") offset.multiplyScalar(1 / 0.88);
    else return;
    event.preventDefault();
    this.camera.position.copy(this.controls.target).add(offset);
    this.invalidate();
  }

  /** What toolbar and legend leave of the view: its middle and size, as parts of the whole. */
  private free(): { x: number; y: number; w: number; h: number } {
    const whole = this.element.getBoundingClientRect();
    let [left, top] = [0, 0];
    for (const one of this.element.querySelectorAll(OVERLAYS)) {
      const { right, bottom, width, height } = one.getBoundingClientRect();
      if (!height) continue;
      if (one.id !== "legend") top = Math.max(top, (bottom - whole.top) / whole.height);
      else if (width < 0.4 * whole.width) left = (right - whole.left) / whole.width;
    }
    return { x: (1 + left) / 2, y: (1 + top) / 2, w: 1 - left, h: 1 - top };
  }

  /** Moves the camera so that everything is seen; keeps the direction of view. */
  fit(): void {
    const free = this.free();
    const { clientWidth: w, clientHeight: h } = this.element;
    const center = this.box.getCenter(new THREE.Vector3());
    const direction = this.camera.position.clone().sub(this.controls.target);
    if (direction.lengthSq() < 1e-12 || !Number.isFinite(direction.x)) direction.set(1, -1.6, 0.7);
    this.camera.position.copy(center).add(direction);
    this.camera.lookAt(center);
    this.camera.updateMatrix();
    const [right, up, back] = [0, 1, 2].map((axis) => new THREE.Vector3().setFromMatrixColumn(this.camera.matrix, axis));
    const half = Math.tan(THREE.MathUtils.degToRad(this.camera.fov / 2));
    const { min, max } = this.box;
    const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((k) => new THREE.Vector3(k & 1 ? max.x : min.x, k & 2 ? max.y : min.y, k & 4 ? max.z : min.z).sub(center));
    const distance = 1.08 * Math.max(...corners.map((c) => c.dot(back) + Math.max(Math.abs(c.dot(right)) / (this.camera.aspect * free.w), Math.abs(c.dot(up)) / free.h) / half));
    this.fitted = true;
    this.controls.target.copy(center);
    this.camera.position.copy(center).addScaledVector(back, distance);
    this.camera.near = distance / 200;
    this.camera.far = distance * 20;
    this.camera.setViewOffset(w, h, (0.5 - free.x) * w, (0.5 - free.y) * h, w, h);
    this.invalidate();
  }

  clear(): void {
    for (const child of [...this.content.children]) dispose(child);
    this.mesh = this.boundary = this.cones = this.solid = null;
    this.sheet = this.features = this.sketch = null;
    this.showPanels(null);
    this.invalidate();
  }

  /** Shows a finished result. keepView: a slider moved, the person did not. */
  show(result: Result, keepView: boolean): void {
    const covered = Boolean(result.panels?.face.length);
    if (this.sheet !== result.mesh || covered !== this.layer.count > 0) this.showSurface(result, covered);
    this.showPanels(result);
    this.toggle(this.shown);
    if (!keepView) this.fit();
  }

  private showSurface(result: Result, covered: boolean): void {
    this.clear();
    const { vertices, faces, features } = result.mesh;
    this.frame(vertices);
    this.mesh = this.meshObject(vertices, faces, covered);
    this.content.add(this.mesh);
    this.sheet = result.mesh;
    this.showCones(result);
    this.features = new FeatureLines(features.map((line) => line.map((v) => this.local(vertices[v]))));
    this.content.add(this.features.group);
  }

  private showPanels(result: Result | null): void {
    const { panels, support } = result ?? {};
    this.layer.show(panels?.polygons.map((polygon) => polygon.map((p) => this.local(p))) ?? []);
    this.labelText = panels ? { text: panels.label, centers: panels.center.map((c) => this.local(c)), normals: panels.normal } : null;
    reshape(this.normals, panels && this.normalLines(panels.center, panels.normal, panels.edge_length));
    reshape(this.supports, support && this.strips(support.strips));
  }

  /** Singularities as dots that can be dragged along the surface. */
  private showCones(result: Result): void {
    const { mesh, map } = result;
    if (!map.cones.length) return;
    this.cones = this.dots(map.cones.map(({ vertex }) => mesh.vertices[vertex]), 0x6a3fa0, 11);
    this.content.add(this.cones);
  }

  /** Where a ray through a pixel first meets the surface, in drawn coordinates. */
  private surfaceAt(x: number, y: number): THREE.Vector3 | null {
    if (!this.sheet) return null;
    if (!this.solid) {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.Float32BufferAttribute(this.sheet.vertices.flatMap((v) => this.local(v)), 3));
      geometry.setIndex(this.sheet.faces.flat());
      this.solid = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ side: THREE.DoubleSide })); // for rays only
    }
    const { clientWidth: w, clientHeight: h } = this.element;
    const ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2((2 * x) / w - 1, 1 - (2 * y) / h), this.camera);
    return ray.intersectObject(this.solid)[0]?.point ?? null;
  }

  /** Where a ray through a pixel first meets the surface. */
  pointAt(x: number, y: number): Vec3 | null {
    const met = this.surfaceAt(x, y);
    return met && [met.x + this.origin.x, met.y + this.origin.y, met.z + this.origin.z];
  }

  /** The feature under a pixel, unless the surface hides it. */
  pickFeature(x: number, y: number): number | null {
    const { clientWidth: w, clientHeight: h } = this.element;
    return this.features?.pick(this.camera, x, y, w, h, (p) => this.isHidden(p)) ?? null;
  }

  hoverFeature(i: number | null): void {
    this.features?.hover(i);
    this.invalidate();
  }

  /** The line that is being drawn. */
  showSketch(points: Vec3[]): void {
    if (this.sketch) dispose(this.sketch);
    this.sketch = null;
    if (points.length) {
      const lines = new FeatureLines([points.map((p) => this.local(p))], true);
      lines.group.add(this.dots(points, 0xd6249f, 9));
      this.content.add((this.sketch = lines.group));
    }
    this.invalidate();
  }

  /** Whether the surface stands before a point of it, with some room for the edge that the point may lie on. */
  private isHidden(p: THREE.Vector3): boolean {
    const { clientWidth: w, clientHeight: h } = this.element;
    const seen = this.surfaceAt(...this.screen(p.clone(), w, h));
    return seen !== null && seen.distanceTo(this.camera.position) < 0.98 * p.distanceTo(this.camera.position);
  }

  /** The singularity within 12 pixels of (x, y), not behind the surface, or null. */
  pickCone(x: number, y: number): number | null {
    if (!this.cones) return null;
    const position = this.cones.geometry.getAttribute("position") as THREE.BufferAttribute;
    const { clientWidth: w, clientHeight: h } = this.element;
    const p = new THREE.Vector3();
    for (let i = 0; i < position.count; i++) {
      p.fromBufferAttribute(position, i);
      const hidden = this.isHidden(p);
      const [px, py] = this.screen(p, w, h);
      if (!hidden && Math.hypot(px - x, py - y) < 12) return i;
    }
    return null;
  }

  private screen(p: THREE.Vector3, w: number, h: number): [number, number] {
    p.project(this.camera);
    return [((p.x + 1) / 2) * w, ((1 - p.y) / 2) * h];
  }

  /** Drags a singularity instead of turning the camera, where one is under the pointer. */
  private grab(event: PointerEvent): void {
    const canvas = this.renderer.domElement;
    const here = (e: PointerEvent): [number, number] => {
      const box = canvas.getBoundingClientRect();
      return [e.clientX - box.left, e.clientY - box.top];
    };
    const start = here(event);
    const i = event.button === 0 && this.onDrag ? this.pickCone(...start) : null;
    if (i === null || !this.cones) return;
    const cones = this.cones;
    const position = cones.geometry.getAttribute("position") as THREE.BufferAttribute;
    const from = new THREE.Vector3().fromBufferAttribute(position, i);
    this.controls.enabled = false;
    let to: THREE.Vector3 | null = null;
    const move = (e: PointerEvent) => {
      const [x, y] = here(e);
      const met = Math.hypot(x - start[0], y - start[1]) < 4 ? null : this.surfaceAt(x, y);
      if (!met) return;
      to = met;
      position.setXYZ(i, met.x, met.y, met.z);
      position.needsUpdate = true;
      this.invalidate();
    };
    const end = (e: PointerEvent) => {
      canvas.ownerDocument.removeEventListener("pointermove", move, true);
      canvas.ownerDocument.removeEventListener("pointerup", end, true);
      canvas.ownerDocument.removeEventListener("pointercancel", end, true);
      this.controls.enabled = true;
      if (to && e.type === "pointerup" && this.cones === cones) {
        this.onDrag?.(i, [to.x + this.origin.x, to.y + this.origin.y, to.z + this.origin.z]);
      } else {
        position.setXYZ(i, from.x, from.y, from.z);
        position.needsUpdate = true;
        this.invalidate();
      }
    };
    canvas.ownerDocument.addEventListener("pointermove", move, true);
    canvas.ownerDocument.addEventListener("pointerup", end, true);
    canvas.ownerDocument.addEventListener("pointercancel", end, true);
  }

  /** Shows a mesh that has not been solved (or was refused), with the faults of the problem in red. */
  showMesh(vertices: Vec3[], faces: number[][], problem: Problem | null): void {
    this.clear();
    this.frame(vertices);
    this.mesh = this.meshObject(vertices, faces, false);
    this.content.add(this.mesh);
    if (problem) this.content.add(this.faults(vertices, faces, problem));
    this.fit();
  }

  private frame(vertices: Vec3[]): void {
    const box = new THREE.Box3();
    for (const v of vertices) if (v.every(Number.isFinite)) box.expandByPoint(new THREE.Vector3(...v));
    if (box.isEmpty()) box.set(new THREE.Vector3(-1, -1, -1), new THREE.Vector3(1, 1, 1));
    // Single precision on the graphics card: everything is drawn about the middle of the model.
    this.origin = box.getCenter(new THREE.Vector3());
    this.box = new THREE.Box3(box.min.clone().sub(this.origin), box.max.clone().sub(this.origin));
  }

  private local(p: Vec3): Vec3 {
    return [p[0] - this.origin.x, p[1] - this.origin.y, p[2] - this.origin.z];
  }

  private meshObject(vertices: Vec3[], faces: number[][], quiet: boolean): THREE.Object3D {
    const position = new Float32Array(vertices.flatMap((v) => this.local(v)));
    const index: number[] = [];
    for (const f of faces) for (let k = 1; k + 1 < f.length; k++) if (f.every((v) => v >= 0 && v < vertices.length)) index.push(f[0], f[k], f[k + 1]);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
    geometry.setIndex(index);
    geometry.computeVertexNormals();
    const material = new THREE.MeshLambertMaterial({
      color: 0xb9c4c4, side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 2,
    });
    const group = new THREE.Group();
    const wire = new THREE.LineSegments(new THREE.WireframeGeometry(geometry), new THREE.LineBasicMaterial({ color: 0x32525a, transparent: true, opacity: quiet ? 0.35 : 0.28 }));
    group.add(wire);
    if (!quiet) group.add(new THREE.Mesh(geometry, material));
    return group;
  }

  private normalLines(centers: Vec3[], normals: Vec3[], lengths: number[]): THREE.BufferGeometry {
    const position = new Float32Array(6 * centers.length);
    centers.forEach((center, i) => {
      const c = this.local(center);
      for (let d = 0; d < 3; d++) {
        position[6 * i + d] = c[d];
        position[6 * i + 3 + d] = c[d] + normals[i][d] * lengths[i];
      }
    });
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
    return geometry;
  }

  private strips(strips: Vec3[][]): THREE.BufferGeometry {
    const position = new Float32Array(strips.flatMap((s) => s.flatMap((p) => this.local(p))));
    const index = new Uint32Array(6 * strips.length);
    for (let i = 0; i < strips.length; i++) index.set([0, 1, 2, 0, 2, 3].map((k) => 4 * i + k), 6 * i);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
    geometry.setIndex(new THREE.BufferAttribute(index, 1));
    const flat = geometry.toNonIndexed();
    flat.computeVertexNormals();
    return flat;
  }

  private faults(vertices: Vec3[], faces: number[][], problem: Problem): THREE.Object3D {
    const group = new THREE.Group();
    const red = 0xd62828;
    const known = (v: number) => v >= 0 && v < vertices.length && vertices[v].every(Number.isFinite);
    const buffer = (points: Vec3[]) => {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.Float32BufferAttribute(points.flatMap((p) => this.local(p)), 3));
      return geometry;
    };
    const dots = (problem.vertices ?? []).filter(known).map((v) => vertices[v]);
    const lines = (problem.edges ?? []).filter((e) => e.every(known)).flatMap(([a, b]) => [vertices[a], vertices[b]]);
    const fills = (problem.faces ?? []).filter((f) => faces[f]?.every(known))
      .flatMap((f) => faces[f].slice(2).flatMap((_, k) => [vertices[faces[f][0]], vertices[faces[f][k + 1]], vertices[faces[f][k + 2]]]));
    const over = { color: red, depthTest: false, transparent: true };
    if (dots.length) group.add(new THREE.Points(buffer(dots), new THREE.PointsMaterial({ ...over, size: 9, sizeAttenuation: false })));
    if (lines.length) {
      group.add(new THREE.LineSegments(buffer(lines), new THREE.LineBasicMaterial(over)));
      group.add(new THREE.Points(buffer(lines), new THREE.PointsMaterial({ ...over, size: 5, sizeAttenuation: false })));
    }
    if (fills.length) group.add(new THREE.Mesh(buffer(fills), new THREE.MeshBasicMaterial({ ...over, opacity: 0.75, side: THREE.DoubleSide })));
    group.renderOrder = 20;
    return group;
  }

  toggle(shown: Toggles): void {
    this.shown = { ...shown };
    this.layer.edges.visible = shown.edges;
    this.normals.visible = shown.normals;
    this.supports.visible = shown.supports;
    if (this.features) this.features.group.visible = shown.features;
    if (this.mesh) this.mesh.visible = shown.mesh || !this.layer.count;
    this.invalidate();
  }

  /** Cuts the model open: axis 0–2, fraction 1 shows all. */
  cut(axis: number, fraction: number): void {
    const low = this.box.min.getComponent(axis);
    const high = this.box.max.getComponent(axis);
    this.section.normal.set(0, 0, 0).setComponent(axis, -1);
    this.section.constant = low + fraction * (high - low) * 1.001;
    this.renderer.clippingPlanes = fraction >= 1 ? [] : [this.section];
    this.invalidate();
  }

  paint(colors: Uint8Array): void {
    this.layer.paint(colors);
    this.invalidate();
  }

  /** Turns the model until what has this normal faces the eye. */
  face(normal: Vec3): void {
    const reach = this.camera.position.distanceTo(this.controls.target);
    const towards = new THREE.Vector3(...normal).normalize();
    if (this.camera.position.clone().sub(this.controls.target).dot(towards) > 0.5 * reach) return;
    this.camera.position.copy(this.controls.target).addScaledVector(towards, reach);
    this.controls.update();
    this.invalidate();
  }

  select(i: number | null): void {
    this.layer.select(i);
    this.invalidate();
  }

  hover(i: number | null): void {
    this.layer.hover(i);
    this.invalidate();
  }

  pick(x: number, y: number): number | null {
    const { clientWidth: w, clientHeight: h } = this.element;
    return this.layer.pick(this.renderer, this.camera, x, y, w, h);
  }

  /** Boundary vertices that can be given angles; marked: those that have one. */
  showBoundary(vertices: Vec3[] | null, loops: number[][], marked: Set<number>): void {
    if (this.boundary) dispose(this.boundary);
    this.boundary = null;
    if (vertices) {
      const list = loops.flat();
      this.boundary = this.dots(list.map((v) => vertices[v]), 0x1f6f78, 4);
      this.boundary.userData.list = list;
      this.boundary.add(this.dots([...marked].map((v) => vertices[v]), 0xe05206, 11));
      this.content.add(this.boundary);
    }
    this.invalidate();
  }

  private dots(points: Vec3[], color: number, size: number): THREE.Points {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(points.flatMap((p) => this.local(p)), 3));
    const dots = new THREE.Points(geometry, new THREE.PointsMaterial({ color, size, sizeAttenuation: false, depthTest: false, transparent: true }));
    dots.renderOrder = 15;
    return dots;
  }

  /** The boundary vertex within 14 pixels of (x, y), nearest to the eye among them. */
  pickBoundary(x: number, y: number): number | null {
    if (!this.boundary) return null;
    const { clientWidth: w, clientHeight: h } = this.element;
    const position = this.boundary.geometry.getAttribute("position");
    let best: { depth: number; distance: number; v: number } | null = null;
    const p = new THREE.Vector3();
    (this.boundary.userData.list as number[]).forEach((v, i) => {
      p.fromBufferAttribute(position as THREE.BufferAttribute, i).project(this.camera);
      const distance = Math.hypot(((p.x + 1) / 2) * w - x, ((1 - p.y) / 2) * h - y);
      if (distance < 14 && (!best || distance + 40 * p.z < best.distance + 40 * best.depth)) best = { depth: p.z, distance, v };
    });
    return best ? (best as { v: number }).v : null;
  }

  /** Where a point of the model stands on the screen, in CSS pixels of this view. */
  project(p: Vec3): { x: number; y: number } {
    const q = new THREE.Vector3(...this.local(p)).project(this.camera);
    return { x: ((q.x + 1) / 2) * this.element.clientWidth, y: ((1 - q.y) / 2) * this.element.clientHeight };
  }

  private placeLabels(): void {
    const { labelText } = this;
    if (!labelText || !this.shown.labels) {
      this.labels.replaceChildren();
      return;
    }
    const { clientWidth: w, clientHeight: h } = this.element;
    const eye = this.camera.position;
    const p = new THREE.Vector3();
    const seen: { x: number; y: number; rank: number; i: number }[] = [];
    labelText.centers.forEach((c, i) => {
      const n = labelText.normals[i];
      if ((eye.x - c[0]) * n[0] + (eye.y - c[1]) * n[1] + (eye.z - c[2]) * n[2] <= 0) return;
      p.set(...c);
      if (this.renderer.clippingPlanes.some((plane) => plane.distanceToPoint(p) < 0)) return;
      p.project(this.camera);
      if (Math.abs(p.x) > 1 || Math.abs(p.y) > 1) return;
      seen.push({ x: ((p.x + 1) / 2) * w, y: ((1 - p.y) / 2) * h, rank: p.x * p.x + p.y * p.y, i });
    });
    seen.sort((a, b) => a.rank - b.rank);
    this.labels.replaceChildren(...withRoom(seen).map(({ x, y, i }) => {
      const span = document.createElement("span");
      span.textContent = labelText.text[i];
      span.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px) translate(-50%, -50%)`;
      return span;
    }));
  }
}

/** Those that do not cover an earlier one, at most MAX_LABELS: a grid of label-sized boxes tells which are near. */
function withRoom<T extends { x: number; y: number }>(places: T[]): T[] {
  const [width, height] = [58, 16];
  const taken = new Map<string, T>();
  const kept: T[] = [];
  for (const place of places) {
    if (kept.length >= MAX_LABELS) break;
    const [column, row] = [Math.floor(place.x / width), Math.floor(place.y / height)];
    let free = true;
    for (let i = -1; i <= 1 && free; i++)
      for (let j = -1; j <= 1 && free; j++) {
        const other = taken.get(`${column + i},${row + j}`);
        free = !other || Math.abs(other.x - place.x) >= width || Math.abs(other.y - place.y) >= height;
      }
    if (!free) continue;
    taken.set(`${column},${row}`, place);
    kept.push(place);
  }
  return kept;
}

function dispose(object: THREE.Object3D): void {
  object.traverse((child) => {
    const drawn = child as THREE.Mesh;
    drawn.geometry?.dispose();
    const material = drawn.material as THREE.Material | undefined;
    material?.dispose?.();
  });
  object.removeFromParent();
}
