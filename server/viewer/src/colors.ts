// Colour per panel for each way of looking, and the legend that explains it.
import type { Result, Vec2 } from "./api";

export type Mode = "size" | "planarity" | "gap" | "distance" | "scale";

export interface Colouring {
  colors: Uint8Array;
  legend: Legend;
}

export type Legend =
  | { kind: "classes"; title: string; rows: { color: string; label: string; count: number }[] }
  | { kind: "ramp"; title: string; low: string; high: string }
  | { kind: "none"; text: string };

/** A perceptually even ramp (dark blue over teal to sand), sampled at nine stops. */
const RAMP = ["#1d2b53", "#1f4e79", "#1f6f78", "#3c8c74", "#6fa56c", "#a5b96b", "#d6c878", "#efdca0", "#fbf1d3"].map(rgb);
const UNSIZED: [number, number, number] = [176, 176, 170];
/** Of more types than this many those after the regular ones share a line and a bar. */
const MOST_ROWS = 24;

export function rgb(hex: string): [number, number, number] {
  const n = parseInt(hex.slice(1), 16);
  return [(n >> 16) & 255, (n >> 8) & 255, n & 255];
}

function ramp(t: number): [number, number, number] {
  const x = Math.min(Math.max(t, 0), 1) * (RAMP.length - 1);
  const i = Math.min(Math.floor(x), RAMP.length - 2);
  return [0, 1, 2].map((c) => Math.round(RAMP[i][c] + (x - i) * (RAMP[i + 1][c] - RAMP[i][c]))) as [number, number, number];
}

export const RAMP_CSS = `linear-gradient(90deg, ${RAMP.map((c, i) => `rgb(${c.join(" ")}) ${(100 * i) / (RAMP.length - 1)}%`).join(", ")})`;

export const MODES: { mode: Mode; label: string; unit: "relative" | "length" | "factor" }[] = [
  { mode: "size", label: "Size", unit: "length" },
  { mode: "planarity", label: "Planarity", unit: "relative" },
  { mode: "gap", label: "Gap", unit: "length" },
  { mode: "distance", label: "Distance", unit: "length" },
  { mode: "scale", label: "Scale factor", unit: "factor" },
];

/** One number per panel, NaN where it has none. */
export function measure(result: Result, mode: Mode): Float64Array {
  const panels = result.panels!;
  const per = (list: (number | null)[] | null | undefined) =>
    Float64Array.from({ length: panels.face.length }, (_, i) => list?.[i] ?? NaN);
  switch (mode) {
    case "size":
      return per(panels.edge_length);
    case "planarity":
      return per(panels.planarity);
    case "gap":
      return per(panels.gap_tangential);
    case "distance":
      return per(panels.surface_distance);
    case "scale":
      return scaleFactors(result);
  }
}

/** e^{-u} at each panel: edge length on the surface over edge length in the domain, mean over the cell. */
function scaleFactors(result: Result): Float64Array {
  const { pattern, panels } = result;
  const out = new Float64Array(panels!.face.length).fill(NaN);
  if (!pattern) return out;
  const corners = cellCorners(result);
  panels!.face.forEach((face, i) => {
    const cell = pattern.faces[face];
    const flat = corners(face);
    let onSurface = 0;
    let inDomain = 0;
    cell.forEach((v, k) => {
      const w = cell[(k + 1) % cell.length];
      const p = pattern.vertices[v];
      const q = pattern.vertices[w];
      onSurface += Math.hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2]);
      const a = flat[k];
      const b = flat[(k + 1) % cell.length];
      inDomain += Math.hypot(a[0] - b[0], a[1] - b[1]);
    });
    out[i] = onSurface / inDomain;
  });
  return out;
}

/** Where the corners of a cell stand in the domain, in one piece. */
export function cellCorners(result: Result): (cell: number) => Vec2[] {
  const { pattern, map } = result;
  if (!pattern) return () => [];
  const { corners } = pattern;
  if (corners) return (cell) => corners[cell];
  const place = placer(map);
  return (cell) => pattern.faces[cell].map((v, k) => place(pattern.uv[v], pattern.sheet?.[cell]?.[k] ?? 0));
}

/** Where the corners of a mesh face stand in the domain. */
export function faceCorners(result: Result): (face: number) => Vec2[] {
  const { mesh, map } = result;
  const { corners, uv, sheet } = map;
  if (!uv || !sheet) return (face) => corners![face];
  const place = placer(map);
  return (face) => mesh.faces[face].map((v, k) => place(uv[v], sheet[face][k]));
}

/** g^s(z) for the deck transformation g(z) = e^{iK} z + t. */
function placer(map: Result["map"]): (z: [number, number], s: number) => [number, number] {
  const { angle, translation } = map.deck!;
  const apex = map.apex;
  return ([x, y], s) => {
    if (!s) return [x, y];
    if (!apex) return [x + s * translation[0], y + s * translation[1]];
    const c = Math.cos(s * angle);
    const d = Math.sin(s * angle);
    const [u, v] = [x - apex[0], y - apex[1]];
    return [apex[0] + c * u - d * v, apex[1] + d * u + c * v];
  };
}

export function colour(result: Result, mode: Mode): Colouring {
  const n = result.panels!.face.length;
  const colors = new Uint8Array(3 * n);
  if (mode === "size" && result.sizes?.length) {
    const table = new Map(result.sizes.map((s) => [s.size, rgb(s.color)]));
    for (let i = 0; i < n; i++) colors.set(table.get(result.panels!.size[i]) ?? UNSIZED, 3 * i);
    const types = collected(result);
    const lengths = (result.sizes ?? []).slice(0, regular(result.sizes ?? [], result.quality.trade_off?.taken)).map((s) => s.edge_length);
    const digits = digitsApart(lengths);
    const rows = types.map((s) => ({
      color: s.color, label: s.types ? `${s.types} other types` : number(s.edge_length, digits), count: s.count,
    }));
    const unsized = result.panels!.size.filter((s) => s < 0).length;
    if (unsized) rows.push({ color: `rgb(${UNSIZED.join(" ")})`, label: "cut to fit", count: unsized });
    return { colors, legend: { kind: "classes", title: inUnit("Edge", result), rows } };
  }
  const values = measure(result, mode);
  const finite = values.filter(Number.isFinite);
  if (!finite.length) {
    for (let i = 0; i < n; i++) colors.set(UNSIZED, 3 * i);
    return { colors, legend: { kind: "none", text: "Not measured for these panels." } };
  }
  let low = Infinity;
  let high = -Infinity;
  for (const v of finite) {
    if (v < low) low = v;
    if (v > high) high = v;
  }
  const range = high - low || 1;
  for (let i = 0; i < n; i++)
    colors.set(Number.isFinite(values[i]) ? ramp(range > Math.max(LEAST, 1e-12 * Math.abs(high)) ? (values[i] - low) / range : 0.5) : UNSIZED, 3 * i);
  const { label, unit } = MODES.find((m) => m.mode === mode)!;
  const title = unit === "relative" ? `${label} / edge` : unit === "length" ? inUnit(label, result) : label;
  return { colors, legend: { kind: "ramp", title, low: number(low), high: number(high) } };
}

/** One type, or the sum of so many. */
export interface Types { edge_length: number; count: number; color: string; types?: number }

/** Regular cells of each size, then the other types; many of these, as along folds, are told together. */
export function collected({ sizes, quality }: Result): Types[] {
  const all = sizes ?? [];
  const others = all.slice(regular(all, quality.trade_off?.taken));
  if (all.length <= MOST_ROWS || !others.length) return all;
  const count = others.reduce((sum, type) => sum + type.count, 0);
  return [...all.slice(0, -others.length), { edge_length: NaN, count, color: others[0].color, types: others.length }];
}

/** How many types are those of regular cells, which come first. */
export const regular = (sizes: Types[], taken: number | null | undefined) => Math.min(taken || sizes.length, sizes.length);

const inUnit = (label: string, { unit }: Result) => `${label}, ${unit ?? "model units"}`;

/** Significant digits that tell neighbouring sizes apart. */
function digitsApart(lengths: number[]): number {
  for (let digits = 4; digits < 10; digits++) if (new Set(lengths.map((x) => number(x, digits))).size === lengths.length) return digits;
  return 10;
}

/** Less is a rounding error, in whatever unit. */
const LEAST = 1e-9;

/** A figure as people read it: four significant digits, no needless zeros. */
export function number(x: number | null | undefined, digits = 4): string {
  if (x === null || x === undefined || !Number.isFinite(x)) return "–";
  if (Math.abs(x) < LEAST) return "0";
  if (Math.abs(x) < 1e-3 || Math.abs(x) >= 1e6) return x.toExponential(1).replace("e+", "e");
  return String(Number(x.toPrecision(digits)));
}
