// Boundary angles given by hand, and the Gauss–Bonnet balance over all loops, equation (1).
import type { Result, Vec3 } from "./api";

export interface Corner {
  /** null: not known before there is a result */
  point: Vec3 | null;
  /** null: not on the boundary, or not known */
  loop: number | null;
  /** multiples of π */
  angle: number;
}

/** Choices that fit a pattern: multiples of 60°, of 90° for patterns of squares, of 180° for bricks. */
export function choices(kind: string): { value: number; label: string }[] {
  const parts = kind === "brick" ? 1 : ["quad", "diamond", "truncated-square"].includes(kind) ? 2 : 3;
  const list = [];
  for (let k = 1; k <= 2 * parts + 1; k++) if (k !== parts) list.push({ value: k / parts, label: `${(180 * k) / parts}°` });
  return list;
}

/** Σ(π − θ) in degrees: of each loop, and of all together less what the surface needs, 2π times χ. */
export function balance(corners: Corner[], result: Result | null): { loops: number[]; total: number } {
  const loops = result?.mesh.loops.map(() => 0) ?? [];
  for (const { loop, angle } of corners) if (loop !== null) loops[loop] += 180 * (1 - angle);
  return { loops, total: corners.reduce((sum, { angle }) => sum + 180 * (1 - angle), 0) - 360 * euler(result) };
}

/** Vertices − edges + faces; every edge has two faces, but those of the boundary one. */
function euler(result: Result | null): number {
  if (!result) return 0;
  const { vertices, faces, loops } = result.mesh;
  return vertices.length - (3 * faces.length + loops.flat().length) / 2 + faces.length;
}

/** Closes the balance: the last corner takes up what is missing if it can, otherwise all share it. */
export function close(corners: Corner[], result: Result | null): Corner[] {
  if (!corners.length) return corners;
  const missing = balance(corners, result).total / 180;
  const last = corners[corners.length - 1];
  const angle = last.angle + missing;
  if (angle > 1e-6 && angle < 2.34) return [...corners.slice(0, -1), { ...last, angle }];
  return corners.map((c) => ({ ...c, angle: c.angle + missing / corners.length }));
}

/** The loop that a vertex lies on. */
export function loopOf(result: Result, vertex: number): number | null {
  const loop = result.mesh.loops.findIndex((vertices) => vertices.includes(vertex));
  return loop < 0 ? null : loop;
}
