// Boundary angles given by hand, and the Gauss–Bonnet balance Σ(π − θ) = 0 over both loops, equation (1).
import type { Result, Vec3 } from "./api";

export interface Corner {
  point: Vec3;
  loop: 0 | 1;
  /** multiples of π */
  angle: number;
}

/** Choices that fit a pattern: multiples of 60° for hexagons and triangles, of 90° for quads. */
export function choices(kind: string): { value: number; label: string }[] {
  const parts = kind === "quad" ? 2 : 3;
  const list = [];
  for (let k = 1; k <= 2 * parts + 1; k++) if (k !== parts) list.push({ value: k / parts, label: `${(180 * k) / parts}°` });
  return list;
}

export function balance(corners: Corner[]): { loops: [number, number]; total: number } {
  const loops: [number, number] = [0, 0];
  for (const c of corners) loops[c.loop] += 180 * (1 - c.angle);
  return { loops, total: loops[0] + loops[1] };
}

/** Closes the balance: the last corner takes up what is missing if it can, otherwise all share it. */
export function close(corners: Corner[]): Corner[] {
  if (!corners.length) return corners;
  const missing = balance(corners).total / 180;
  const last = corners[corners.length - 1];
  const angle = last.angle + missing;
  if (angle > 1e-6 && angle < 2.34) return [...corners.slice(0, -1), { ...last, angle }];
  return corners.map((c) => ({ ...c, angle: c.angle + missing / corners.length }));
}

export function loopOf(result: Result, vertex: number): 0 | 1 {
  return result.mesh.loops[0].includes(vertex) ? 0 : 1;
}
