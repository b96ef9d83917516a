// Lines that the pattern follows: creases and drawn ones. Shown in both views, left out by a click, drawn by clicks.
import * as THREE from "three";
import { LineMaterial } from "three/examples/jsm/lines/LineMaterial.js";
import { LineSegments2 } from "three/examples/jsm/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/examples/jsm/lines/LineSegmentsGeometry.js";
import type { Result, Vec2, Vec3 } from "./api";

const COLOR = 0xd6249f;
const POINTED = 0xd62828;
/** A feature is met by the pointer within so many pixels. */
const REACH = 6;

/** What a request says about features. */
export interface Features {
  angle: number | null;
  lines: Vec3[][];
  without: Vec3[][];
}

/** The features of one view, in its own coordinates. */
export class FeatureLines {
  readonly group = new THREE.Group();
  private pointed: THREE.Object3D | null = null;
  private readonly segments: [Vec3, Vec3][];
  private readonly feature: number[];

  /** lines: points of each; above: drawn over everything. */
  constructor(lines: Vec3[][], private readonly above = false, feature?: number[]) {
    this.segments = lines.flatMap((line) => line.slice(1).map((p, i): [Vec3, Vec3] => [line[i], p]));
    this.feature = feature ?? lines.flatMap((line, i) => line.slice(1).map(() => i));
    if (this.segments.length) this.group.add(this.drawn(this.segments, COLOR, 3));
  }

  /** Edges of faces that lie on features, where the faces stand in the domain. */
  static inDomain(mesh: Result["mesh"], corners: (face: number) => Vec2[]): FeatureLines {
    const key = (a: number, b: number) => (a < b ? `${a},${b}` : `${b},${a}`);
    const on = new Map(mesh.features.flatMap((line, i) => line.slice(1).map((v, k): [string, number] => [key(line[k], v), i])));
    const lines: Vec3[][] = [];
    const feature: number[] = [];
    if (on.size)
      mesh.faces.forEach((f, face) => {
        for (let k = 0; k < 3; k++) {
          const i = on.get(key(f[k], f[(k + 1) % 3]));
          if (i === undefined) continue;
          const at = corners(face);
          lines.push([[...at[k], 0.015], [...at[(k + 1) % 3], 0.015]]);
          feature.push(i);
        }
      });
    return new FeatureLines(lines, false, feature);
  }

  /** The feature nearest to a pixel of a view (w × h), within reach; hidden: points that cannot be seen. */
  pick(camera: THREE.Camera, x: number, y: number, w: number, h: number, hidden: (p: THREE.Vector3) => boolean = () => false): number | null {
    if (!this.group.visible) return null;
    let [best, least] = [-1, REACH];
    const onScreen = (p: Vec3) => new THREE.Vector3(...p).project(camera);
    this.segments.forEach(([from, to], i) => {
      const [a, b] = [onScreen(from), onScreen(to)];
      if (Math.abs(a.z) > 1 || Math.abs(b.z) > 1) return; // beside or behind the eye
      const [ax, ay, bx, by] = [((a.x + 1) * w) / 2, ((1 - a.y) * h) / 2, ((b.x + 1) * w) / 2, ((1 - b.y) * h) / 2];
      const squared = (bx - ax) ** 2 + (by - ay) ** 2;
      const t = squared ? Math.min(Math.max(((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / squared, 0), 1) : 0;
      const distance = Math.hypot(ax + t * (bx - ax) - x, ay + t * (by - ay) - y);
      if (distance >= least) return;
      if (!hidden(new THREE.Vector3(...from).lerp(new THREE.Vector3(...to), t))) [best, least] = [i, distance];
    });
    return best < 0 ? null : this.feature[best];
  }

  /** Shows which one a click would remove. */
  hover(i: number | null): void {
    if (this.pointed) dispose(this.pointed);
    this.pointed = null;
    if (i === null) return;
    const mine = this.segments.filter((_, k) => this.feature[k] === i);
    if (mine.length) this.group.add((this.pointed = this.drawn(mine, POINTED, 6)));
  }

  private drawn(segments: [Vec3, Vec3][], color: number, linewidth: number): THREE.Object3D {
    const geometry = new LineSegmentsGeometry().setPositions(segments.flat(2));
    // Nearer by a little, so that panels beside a line do not cover half of it.
    const material = new LineMaterial({ color, linewidth, depthTest: !this.above, polygonOffset: true, polygonOffsetFactor: -6, polygonOffsetUnits: -6 });
    const lines = new LineSegments2(geometry, material);
    lines.renderOrder = 14;
    return lines;
  }
}

function dispose(object: THREE.Object3D): void {
  const { geometry, material } = object as LineSegments2;
  geometry.dispose();
  material.dispose();
  object.removeFromParent();
}

/** The request without feature i of a result: a drawn line is no longer given, a crease is named as unwanted. */
export function without(asked: Features, result: Result, i: number): Features {
  if (i < asked.lines.length) return { ...asked, lines: asked.lines.filter((_, k) => k !== i) };
  const { vertices, features } = result.mesh;
  return { ...asked, without: [...asked.without, straightened(features[i].map((v) => vertices[v]))] };
}

/** A polyline without the points that lie on the straight line between the ones that are kept beside them. */
function straightened(line: Vec3[]): Vec3[] {
  const minus = (p: Vec3, q: Vec3) => new THREE.Vector3(p[0] - q[0], p[1] - q[1], p[2] - q[2]);
  const kept = [line[0]];
  for (let i = 1; i + 1 < line.length; i++) {
    const [before, after] = [minus(line[i], kept[kept.length - 1]), minus(line[i + 1], line[i])];
    if (before.angleTo(after) > 1e-6) kept.push(line[i]);
  }
  return [...kept, line[line.length - 1]];
}

/** A line that is drawn point by point; what happens to it is told to `shown`, and `done` gets it at the end. */
export class LineDrawing {
  on = false;
  private points: Vec3[] = [];
  private pixels: Vec2[] = [];

  constructor(private readonly shown: (points: Vec3[], on: boolean) => void, private readonly done: (line: Vec3[]) => void) {}

  start(): void {
    this.reset(true);
  }

  cancel(): void {
    this.reset(false);
  }

  /** A click at a pixel, on a point of the surface; one on the first point closes the line. */
  add(point: Vec3 | null, x: number, y: number): void {
    const near = (pixel?: Vec2) => pixel !== undefined && Math.hypot(pixel[0] - x, pixel[1] - y) < 8;
    if (!point || near(this.pixels.at(-1))) return; // beside the surface, or the second click of a double one
    if (this.points.length > 2 && near(this.pixels[0])) {
      this.points.push(this.points[0]);
      return this.finish();
    }
    this.points.push(point);
    this.pixels.push([x, y]);
    this.shown(this.points, true);
  }

  finish(): void {
    const line = this.points;
    if (line.length < 2) return;
    this.reset(false);
    this.done(line);
  }

  private reset(on: boolean): void {
    this.on = on;
    this.points = [];
    this.pixels = [];
    this.shown([], on);
  }
}
