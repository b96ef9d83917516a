// Many polygons as one merged geometry: fills, outlines and a pick pass that answers "which polygon is here".
import * as THREE from "three";

export interface PolygonData {
  /** All corners, x y z one after the other. */
  points: Float32Array;
  /** offsets[i] .. offsets[i+1] are the corners of polygon i. */
  offsets: Uint32Array;
}

function pack(polygons: ArrayLike<number>[][]): PolygonData {
  const offsets = new Uint32Array(polygons.length + 1);
  polygons.forEach((polygon, i) => (offsets[i + 1] = offsets[i] + polygon.length));
  const points = new Float32Array(3 * offsets[polygons.length]);
  let k = 0;
  for (const polygon of polygons)
    for (const p of polygon) {
      points[k++] = p[0];
      points[k++] = p[1];
      points[k++] = p.length > 2 ? p[2] : 0;
    }
  return { points, offsets };
}

/** Corner indices of triangles that fill each polygon; fans where convex, ear clipping where not. */
function triangulate({ points, offsets }: PolygonData): { corners: Uint32Array; owner: Uint32Array } {
  const corners: number[] = [];
  const owner: number[] = [];
  for (let i = 0; i + 1 < offsets.length; i++) {
    const start = offsets[i];
    const n = offsets[i + 1] - start;
    const fan = n <= 4 || isConvex(points, start, n);
    const local = fan ? fanOf(n) : earsOf(points, start, n);
    for (const [a, b, c] of local) {
      corners.push(start + a, start + b, start + c);
      owner.push(i);
    }
  }
  return { corners: Uint32Array.from(corners), owner: Uint32Array.from(owner) };
}

function fanOf(n: number): number[][] {
  return Array.from({ length: Math.max(n - 2, 0) }, (_, k) => [0, k + 1, k + 2]);
}

const at = (points: Float32Array, i: number) => new THREE.Vector3().fromArray(points, 3 * i);

/** Area vector of a polygon (Newell): its direction is the normal, its length twice the area. */
export function areaVector(points: Float32Array, start: number, n: number): THREE.Vector3 {
  const sum = new THREE.Vector3();
  const origin = at(points, start);
  for (let k = 1; k + 1 < n; k++) {
    const a = at(points, start + k).sub(origin);
    sum.add(a.cross(at(points, start + k + 1).sub(origin)));
  }
  return sum;
}

function isConvex(points: Float32Array, start: number, n: number): boolean {
  const normal = areaVector(points, start, n);
  for (let k = 0; k < n; k++) {
    const a = at(points, start + k);
    const b = at(points, start + ((k + 1) % n));
    const c = at(points, start + ((k + 2) % n));
    if (b.clone().sub(a).cross(c.sub(b)).dot(normal) < 0) return false;
  }
  return true;
}

function earsOf(points: Float32Array, start: number, n: number): number[][] {
  const normal = areaVector(points, start, n).normalize();
  const x = Math.abs(normal.x) < 0.9 ? new THREE.Vector3(1, 0, 0) : new THREE.Vector3(0, 1, 0);
  x.sub(normal.clone().multiplyScalar(x.dot(normal))).normalize();
  const y = normal.clone().cross(x);
  const flat = Array.from({ length: n }, (_, k) => {
    const p = at(points, start + k);
    return new THREE.Vector2(p.dot(x), p.dot(y));
  });
  return THREE.ShapeUtils.triangulateShape(flat, []);
}

/** Colour that encodes an index (0 is "nothing"), exact in an 8-bit target without colour management. */
function idBytes(i: number): [number, number, number] {
  const id = i + 1;
  return [id & 255, (id >> 8) & 255, (id >> 16) & 255];
}

const PICK_VERTEX = `
attribute vec3 id; varying vec3 vId;
#include <clipping_planes_pars_vertex>
void main() { vId = id;
  #include <begin_vertex>
  #include <project_vertex>
  #include <clipping_planes_vertex>
}`;
const PICK_FRAGMENT = `
varying vec3 vId;
#include <clipping_planes_pars_fragment>
void main() {
  #include <clipping_planes_fragment>
  gl_FragColor = vec4(vId, 1.0); }`;

/** 8-bit sRGB → 16-bit linear light, in which the graphics card reckons. */
const LINEAR = Uint16Array.from({ length: 256 }, (_, i) => {
  const x = i / 255;
  return Math.round(65535 * (x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4));
});

export class PolygonLayer {
  readonly group = new THREE.Group();
  readonly edges = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: 0x15262b, transparent: true, opacity: 0.55 }));
  count = 0;
  private readonly fills: THREE.Mesh;
  private readonly picker = new THREE.Mesh(new THREE.BufferGeometry(), new THREE.ShaderMaterial({
    vertexShader: PICK_VERTEX, fragmentShader: PICK_FRAGMENT, side: THREE.DoubleSide, clipping: true,
  }));
  private data: PolygonData = pack([]);
  /** The polygon of each triangle. */
  private owner: Uint32Array = new Uint32Array();
  private readonly pickScene = new THREE.Scene();
  private readonly chosen = new Mark(0xff6a13, 0.75);
  readonly pointed = new Mark(0xffb347, 0.45);

  constructor(lit: boolean) {
    this.fills = new THREE.Mesh(this.picker.geometry, fillMaterial(lit));
    this.pickScene.add(this.picker);
    this.edges.renderOrder = 1; // over the wires of a mesh
    this.group.add(this.fills, this.edges, this.chosen.group, this.pointed.group);
  }

  show(polygons: ArrayLike<number>[][]): void {
    this.data = pack(polygons);
    this.count = polygons.length;
    const { corners, owner } = triangulate(this.data);
    this.owner = owner;
    reshape(this.fills, this.fillGeometry(corners));
    this.picker.geometry = this.fills.geometry;
    reshape(this.edges, this.edgeGeometry());
    this.select(null);
    this.hover(null);
  }

  private fillGeometry(corners: Uint32Array): THREE.BufferGeometry {
    const { points, offsets } = this.data;
    const normals = new Float32Array(3 * this.count);
    for (let i = 0; i < this.count; i++)
      areaVector(points, offsets[i], offsets[i + 1] - offsets[i]).normalize().toArray(normals, 3 * i);
    const position = new Float32Array(3 * corners.length);
    const normal = new Float32Array(3 * corners.length);
    const id = new Uint8Array(3 * corners.length);
    for (let k = 0; k < corners.length; k++) {
      const polygon = this.owner[(k / 3) | 0];
      for (let d = 0; d < 3; d++) {
        position[3 * k + d] = points[3 * corners[k] + d];
        normal[3 * k + d] = normals[3 * polygon + d];
      }
      id.set(idBytes(polygon), 3 * k);
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
    geometry.setAttribute("normal", new THREE.BufferAttribute(normal, 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(new Uint16Array(3 * corners.length).fill(40000), 3, true));
    geometry.setAttribute("id", new THREE.BufferAttribute(id, 3, true));
    return geometry;
  }

  private edgeGeometry(): THREE.BufferGeometry {
    const { points, offsets } = this.data;
    const index = new Uint32Array(points.length / 3 * 2);
    let k = 0;
    for (let i = 0; i < this.count; i++)
      for (let c = offsets[i]; c < offsets[i + 1]; c++) {
        index[k++] = c;
        index[k++] = c + 1 < offsets[i + 1] ? c + 1 : offsets[i];
      }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(points, 3));
    geometry.setIndex(new THREE.BufferAttribute(index, 1));
    return geometry;
  }

  /** colors: r g b (0–255) per polygon. */
  paint(colors: Uint8Array): void {
    const attribute = this.fills.geometry.getAttribute("color") as THREE.BufferAttribute;
    const array = attribute.array as Uint16Array;
    for (let t = 0; t < this.owner.length; t++) {
      const i = 3 * this.owner[t];
      for (let c = 0; c < 3; c++) {
        const k = 9 * t + 3 * c;
        array[k] = LINEAR[colors[i]];
        array[k + 1] = LINEAR[colors[i + 1]];
        array[k + 2] = LINEAR[colors[i + 2]];
      }
    }
    attribute.needsUpdate = true;
  }

  select(i: number | null): void {
    this.chosen.show(this.corners(i));
  }

  hover(i: number | null): void {
    this.pointed.show(this.corners(i));
  }

  private corners(i: number | null): Float32Array | null {
    const { points, offsets } = this.data;
    return i === null || i >= this.count ? null : points.slice(3 * offsets[i], 3 * offsets[i + 1]);
  }

  /** The polygon drawn at pixel (x, y) of a canvas of w × h, or null: the scene once more, ids for colours, one pixel. */
  pick(renderer: THREE.WebGLRenderer, camera: THREE.PerspectiveCamera | THREE.OrthographicCamera, x: number, y: number, w: number, h: number): number | null {
    if (!this.group.visible || !this.count) return null;
    const target = new THREE.WebGLRenderTarget(1, 1);
    const clear = renderer.getClearColor(new THREE.Color());
    const alpha = renderer.getClearAlpha();
    const view = camera.view && { ...camera.view };
    camera.setViewOffset(w, h, x + (view?.offsetX ?? 0), y + (view?.offsetY ?? 0), 1, 1);
    camera.updateProjectionMatrix();
    const before = renderer.getRenderTarget();
    renderer.setRenderTarget(target);
    renderer.setClearColor(0, 0);
    renderer.clear();
    renderer.render(this.pickScene, camera);
    const pixel = new Uint8Array(4);
    renderer.readRenderTargetPixels(target, 0, 0, 1, 1, pixel);
    renderer.setRenderTarget(before);
    renderer.setClearColor(clear, alpha);
    if (view) camera.setViewOffset(view.fullWidth, view.fullHeight, view.offsetX, view.offsetY, view.width, view.height);
    else camera.clearViewOffset();
    camera.updateProjectionMatrix();
    target.dispose();
    const id = pixel[0] + (pixel[1] << 8) + (pixel[2] << 16);
    return id > 0 && id <= this.count ? id - 1 : null;
  }
}

/** Another geometry for an object that stays: with its material stays its program, which takes long to compile. */
export function reshape(object: THREE.Mesh | THREE.LineSegments, geometry?: THREE.BufferGeometry | null): void {
  object.geometry.dispose();
  object.geometry = geometry ?? new THREE.BufferGeometry();
}

function fillMaterial(lit: boolean): THREE.Material {
  const common = {
    vertexColors: true, side: THREE.DoubleSide,
    polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
  };
  return lit ? new THREE.MeshLambertMaterial(common) : new THREE.MeshBasicMaterial(common);
}

/** One polygon made to stand out: filled and outlined, in front of everything. */
class Mark {
  readonly group = new THREE.Group();
  private readonly fill: THREE.Mesh;
  private readonly line: THREE.LineLoop;

  constructor(color: number, opacity: number) {
    const over = { color, depthTest: false, transparent: true, side: THREE.DoubleSide };
    this.fill = new THREE.Mesh(new THREE.BufferGeometry(), new THREE.MeshBasicMaterial({ ...over, opacity }));
    this.line = new THREE.LineLoop(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: 0x5a2500, depthTest: false }));
    this.group.add(this.fill, this.line);
    this.group.visible = false;
    for (const object of [this.fill, this.line]) {
      object.renderOrder = 10;
      object.frustumCulled = false;
    }
  }

  show(corners: Float32Array | null): void {
    this.group.visible = corners !== null;
    this.fill.geometry.dispose();
    this.line.geometry.dispose();
    if (!corners) return;
    const position = new THREE.BufferAttribute(corners, 3);
    const data = { points: corners, offsets: Uint32Array.from([0, corners.length / 3]) };
    this.fill.geometry = new THREE.BufferGeometry().setAttribute("position", position);
    this.fill.geometry.setIndex(new THREE.BufferAttribute(triangulate(data).corners, 1));
    this.line.geometry = new THREE.BufferGeometry().setAttribute("position", position);
  }
}
