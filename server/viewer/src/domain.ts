// The unrolled domain: pattern cells, mesh boundary, corners; linked with the view in space through panel numbers.
import * as THREE from "three";
import { MapControls } from "three/examples/jsm/controls/MapControls.js";
import type { Result, Vec2 } from "./api";
import { cellCorners, faceCorners } from "./colors";
import { FeatureLines } from "./features";
import { PolygonLayer } from "./polygons";

const CORNER_TOLERANCE = 1e-3;

export class DomainView {
  private readonly renderer: THREE.WebGLRenderer;
  private readonly camera = new THREE.OrthographicCamera(-1, 1, 1, -1, -10, 10);
  private readonly controls: MapControls;
  private readonly scene = new THREE.Scene();
  private readonly marks = new THREE.Group();
  private readonly layer = new PolygonLayer(false);
  private features: FeatureLines | null = null;
  private panelOfPolygon: number[] = [];
  private polygonOfPanel = new Map<number, number>();
  /** What is drawn: it stays while it is the same. */
  private map: Result["map"] | null = null;
  private pattern: Result["pattern"] = null;
  /** Of the mesh in the domain: everything is drawn about it. */
  private middle: Vec2 = [0, 0];
  private readonly outline = new THREE.Box2();
  private readonly box = new THREE.Box2(new THREE.Vector2(-1, -1), new THREE.Vector2(1, 1));
  private next = 0;

  constructor(readonly element: HTMLElement) {
    this.renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    const canvas = this.renderer.domElement;
    canvas.tabIndex = 0;
    canvas.setAttribute("aria-label", "Unrolled domain with the pattern");
    element.prepend(canvas);
    this.camera.position.set(0, 0, 5);
    this.controls = new MapControls(this.camera, canvas);
    this.controls.enableRotate = false;
    this.controls.screenSpacePanning = true;
    this.controls.zoomToCursor = true;
    this.controls.mouseButtons.LEFT = THREE.MOUSE.PAN;
    this.controls.addEventListener("change", () => this.invalidate());
    this.scene.add(this.layer.group, this.marks);
    new ResizeObserver(() => this.fit()).observe(element);
    this.invalidate();
  }

  /** Draws in the next frame; a still picture costs nothing. */
  invalidate(): void {
    this.next ||= requestAnimationFrame(() => {
      this.next = 0;
      this.controls.update();
      this.renderer.render(this.scene, this.camera);
    });
  }

  clear(): void {
    this.layer.show([]);
    this.map = this.pattern = this.features = null;
    for (const mark of this.marks.children) (mark as THREE.Points).geometry?.dispose();
    this.marks.clear();
    this.polygonOfPanel.clear();
    this.invalidate();
  }

  show(result: Result, keepView: boolean): void {
    if (this.map !== result.map) this.showMap(result);
    if (this.pattern !== result.pattern) this.showCells(result);
    this.select(null);
    this.hover(null);
    this.panelOfPolygon = new Array(this.layer.count).fill(-1);
    this.polygonOfPanel.clear();
    result.panels?.face.forEach((face, i) => {
      this.panelOfPolygon[face] = i;
      this.polygonOfPanel.set(i, face);
    });
    if (!keepView) this.fit();
    this.invalidate();
  }

  private showMap(result: Result): void {
    this.clear();
    this.map = result.map;
    const flat = moved(faceCorners(result), result.map.apart?.face, result.map.apart?.shift);
    this.middle = this.middleOf(result.mesh.faces.map((_, i) => flat(i)[0]));
    const corners = result.mesh.faces.map((_, i) => flat(i).map((z) => this.local(z)));
    this.drawBoundary(result, (face) => corners[face]);
    this.box.copy(this.outline);
    this.features = FeatureLines.inDomain(result.mesh, (face) => corners[face]);
    this.marks.add(this.features.group);
  }

  private showCells(result: Result): void {
    this.pattern = result.pattern;
    const flat = moved(cellCorners(result), result.map.apart?.cell, result.map.apart?.shift);
    const cells = result.pattern?.faces.map((_, f) => flat(f).map((z) => this.local(z))) ?? [];
    this.layer.show(cells);
    this.box.copy(this.outline);
    for (const cell of cells) for (const p of cell) this.box.expandByPoint(new THREE.Vector2(...p));
  }

  private local([x, y]: Vec2): Vec2 {
    return [x - this.middle[0], y - this.middle[1]];
  }

  private middleOf(uv: Vec2[]): Vec2 {
    let [x, y] = [0, 0];
    for (const p of uv) {
      x += p[0];
      y += p[1];
    }
    return [x / uv.length, y / uv.length];
  }

  /** Mesh boundary as drawn by the faces that hold it, corners as dots, the cut's two images left open. */
  private drawBoundary(result: Result, corners: (face: number) => Vec2[]): void {
    this.outline.makeEmpty();
    const { mesh, map } = result;
    const count = new Map<string, number>();
    const key = (a: number, b: number) => (a < b ? `${a},${b}` : `${b},${a}`);
    for (const f of mesh.faces) for (let k = 0; k < 3; k++) count.set(key(f[k], f[(k + 1) % 3]), (count.get(key(f[k], f[(k + 1) % 3])) ?? 0) + 1);
    const corner = new Set<number>();
    mesh.loops.forEach((loop, l) => loop.forEach((v, i) => Math.abs(map.boundary_angles[l][i] - Math.PI) > 0.02 && corner.add(v)));
    const curved = corner.size > 24; // an isometric boundary bends at every vertex: no corners to mark
    const lines: number[] = [];
    const dots: number[] = [];
    const singular = new Set(map.cones.map((cone) => cone.vertex));
    const centres: number[] = [];
    mesh.faces.forEach((f, i) => {
      const at = corners(i);
      f.forEach((v, k) => singular.has(v) && centres.push(...at[k], 0.02));
      for (let k = 0; k < 3; k++) {
        const [a, b] = [f[k], f[(k + 1) % 3]];
        if (count.get(key(a, b)) !== 1) continue;
        const p = at[k];
        const q = at[(k + 1) % 3];
        lines.push(...p, 0.01, ...q, 0.01);
        this.outline.expandByPoint(new THREE.Vector2(...p));
        if (!curved && corner.has(a)) dots.push(...p, 0.02);
      }
    });
    this.marks.add(new THREE.LineSegments(positions(lines), new THREE.LineBasicMaterial({ color: 0xc2410c })));
    if (dots.length) this.marks.add(new THREE.Points(positions(dots), new THREE.PointsMaterial({ color: 0xc2410c, size: 8, sizeAttenuation: false })));
    if (centres.length) this.marks.add(new THREE.Points(positions(centres), new THREE.PointsMaterial({ color: 0x6a3fa0, size: 8, sizeAttenuation: false })));
    if (map.apex && !map.apart && this.outline.clone().expandByScalar(0.3 * this.outline.getSize(new THREE.Vector2()).length()).containsPoint(new THREE.Vector2(...this.local(map.apex))))
      this.marks.add(new THREE.Points(positions([...this.local(map.apex), 0.02]), new THREE.PointsMaterial({ color: 0x1f6f78, size: 7, sizeAttenuation: false })));
  }

  fit(): void {
    const { clientWidth: w, clientHeight: h } = this.element;
    if (!w || !h) return;
    this.renderer.setSize(w, h);
    const size = this.box.getSize(new THREE.Vector2());
    const center = this.box.getCenter(new THREE.Vector2());
    const half = (Math.max(size.y, (size.x * h) / w, CORNER_TOLERANCE) / 2) * 1.06;
    Object.assign(this.camera, { left: (-half * w) / h, right: (half * w) / h, top: half, bottom: -half, zoom: 1 });
    this.camera.position.set(center.x, center.y, 5);
    this.controls.target.set(center.x, center.y, 0);
    this.camera.updateProjectionMatrix();
    this.invalidate();
  }

  paint(panelColors: Uint8Array): void {
    const colors = new Uint8Array(3 * this.layer.count).fill(205);
    this.polygonOfPanel.forEach((polygon, panel) => colors.set(panelColors.subarray(3 * panel, 3 * panel + 3), 3 * polygon));
    this.layer.paint(colors);
    this.invalidate();
  }

  select(panel: number | null): void {
    this.layer.select(panel === null ? null : this.polygonOfPanel.get(panel) ?? null);
    this.invalidate();
  }

  hover(panel: number | null): void {
    this.layer.hover(panel === null ? null : this.polygonOfPanel.get(panel) ?? null);
    this.invalidate();
  }

  pickFeature(x: number, y: number): number | null {
    return this.features?.pick(this.camera, x, y, this.element.clientWidth, this.element.clientHeight) ?? null;
  }

  hoverFeature(i: number | null): void {
    this.features?.hover(i);
    this.invalidate();
  }

  showFeatures(visible: boolean): void {
    if (this.features) this.features.group.visible = visible;
    this.invalidate();
  }

  pick(x: number, y: number): number | null {
    const polygon = this.layer.pick(this.renderer, this.camera, x, y, this.element.clientWidth, this.element.clientHeight);
    const panel = polygon === null || polygon === undefined ? -1 : this.panelOfPolygon[polygon];
    this.invalidate();
    return panel < 0 ? null : panel;
  }
}

/** The same outlines, moved with the piece of the domain that each belongs to. */
function moved(outline: (i: number) => Vec2[], piece: number[] | null | undefined, shift: Vec2[] | undefined): (i: number) => Vec2[] {
  if (!piece || !shift) return outline;
  return (i) => outline(i).map(([x, y]): Vec2 => [x + shift[piece[i]][0], y + shift[piece[i]][1]]);
}

function positions(flat: number[]): THREE.BufferGeometry {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(flat, 3));
  return geometry;
}
