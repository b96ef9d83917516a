// Two small charts: how many panels of each size, and what each number of sizes would leave uncovered.
import type { SingularityCurve, TradeOff } from "./api";
import { number, type Types } from "./colors";

const NS = "http://www.w3.org/2000/svg";

export function svg(tag: string, attributes: Record<string, string | number>, ...children: (Node | string)[]): SVGElement {
  const element = document.createElementNS(NS, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
  element.append(...children);
  return element;
}

const W = 340;
const H = 132;
const PAD = { left: 40, right: 8, top: 10, bottom: 24 };

/** regular: how many come first, in ascending order; those of singularities and pieces of cells follow. */
export function histogram(sizes: Types[], regular: number): SVGElement {
  const root = svg("svg", { viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": "Panels per size" });
  const most = Math.max(...sizes.map((s) => s.count), 1);
  const width = (W - PAD.left - PAD.right) / sizes.length;
  sizes.forEach((s, i) => {
    const h = ((H - PAD.top - PAD.bottom) * s.count) / most;
    const bar = svg("rect", {
      x: PAD.left + i * width + 0.5, y: H - PAD.bottom - h, width: Math.max(width - 1.5, 0.7), height: Math.max(h, 0.8), fill: s.color, rx: 1.5,
    });
    bar.append(svg("title", {}, `${s.types ? `${s.types} other types` : `edge ${number(s.edge_length)}`}: ${s.count} panels`));
    root.append(bar);
  });
  root.append(
    svg("line", { x1: PAD.left, x2: W - PAD.right, y1: H - PAD.bottom, y2: H - PAD.bottom, class: "axis" }),
    svg("text", { x: PAD.left - 5, y: PAD.top + 8, "text-anchor": "end" }, String(most)),
    svg("text", { x: PAD.left, y: H - 8 }, number(sizes[0].edge_length)),
    svg("text", { x: PAD.left + regular * width, y: H - 8, "text-anchor": "end" }, regular > 1 ? number(sizes[regular - 1].edge_length) : ""),
  );
  return root;
}

/** One number that may be chosen: where it stands along the curve, and what it leaves uncovered. */
interface Choice {
  value: number;
  uncovered: number;
  current: boolean;
  marked: boolean;
  label: string;
  title: string;
  /** what clicking it does; null: nothing is gained by it */
  choose: (() => void) | null;
}

/** The uncovered area for each number of something. */
function curveOf(choices: Choice[], label: string): SVGElement {
  const root = svg("svg", { viewBox: `0 0 ${W} ${H}`, class: "curve", "aria-label": label });
  const n = choices.length;
  const width = (W - PAD.left - PAD.right) / n;
  const top = Math.max(...choices.map((c) => c.uncovered), 1e-9);
  const x = (i: number) => PAD.left + width * (i + 0.5);
  const y = (u: number) => H - PAD.bottom - ((H - PAD.top - PAD.bottom) * u) / top;
  root.append(
    svg("line", { x1: PAD.left, x2: W - PAD.right, y1: H - PAD.bottom, y2: H - PAD.bottom, class: "axis" }),
    svg("text", { x: PAD.left - 5, y: PAD.top + 8, "text-anchor": "end" }, top > 1e-6 ? `${number(100 * top, 2)} %` : ""),
    svg("text", { x: PAD.left - 5, y: H - PAD.bottom, "text-anchor": "end" }, "0"),
    svg("polyline", { points: choices.map((c, i) => `${x(i)},${y(c.uncovered)}`).join(" "), class: "line" }),
  );
  choices.forEach((c, i) => {
    const open: Record<string, string | number> = c.choose ? { tabindex: 0, role: "button" } : { "aria-disabled": "true" };
    const spot = svg("g", { class: `spot${c.current ? " current" : ""}${c.choose ? "" : " closed"}`, ...open, "data-k": c.value, "aria-label": c.label });
    spot.append(
      svg("rect", { x: x(i) - width / 2, y: 0, width, height: H, fill: "transparent" }),
      svg("circle", { cx: x(i), cy: y(c.uncovered), r: c.current ? 5 : 2.6 }),
      svg("title", {}, c.title),
    );
    if (c.choose) {
      const choose = c.choose;
      spot.addEventListener("click", choose);
      spot.addEventListener("keydown", (event) => {
        if ((event as KeyboardEvent).key === "Enter" || (event as KeyboardEvent).key === " ") choose();
      });
    }
    root.append(spot);
    if (c.marked) root.append(svg("text", { x: x(i), y: H - 8, "text-anchor": "middle" }, String(c.value)));
  });
  return root;
}

export function tradeOff(curve: TradeOff, choose: (k: number) => void): SVGElement {
  const current = curve.taken;
  const choices = curve.sizes.map((k, i): Choice => {
    const label = `${k} sizes: ${number(100 * curve.uncovered[i], 3)} % uncovered`;
    return {
      value: k, uncovered: curve.uncovered[i], current: k === current, marked: k === current || ((k === 1 || k % 10 === 0) && Math.abs(k - current) * 14 > curve.sizes.length),
      label, title: `${label}, worst gap ${number(curve.worst_gap[i])}`, choose: () => choose(k),
    };
  });
  return curveOf(choices, "Uncovered area for each number of sizes");
}

/** Numbers that leave no less than a smaller one cannot be chosen. */
export function singularityCurve(curve: SingularityCurve, choose: (n: number) => void): SVGElement {
  const choices = curve.number.map((n, i): Choice => {
    const current = i === curve.taken;
    const better = curve.uncovered.slice(0, i).every((u) => u > curve.uncovered[i]);
    const label = `${n} singularities: ${current ? "" : "about "}${number(100 * curve.uncovered[i], 3)} % uncovered`;
    return {
      value: n, uncovered: curve.uncovered[i], current, marked: true, label,
      title: `${label} in ${curve.sizes} sizes`, choose: better && !current ? () => choose(n) : null,
    };
  });
  return curveOf(choices, "Uncovered area for each number of singularities");
}

/** A panel laid flat, as a small outline with its edge lengths. */
export function flatOutline(polygon: [number, number, number][], normal: [number, number, number]): SVGElement {
  const sub = (a: number[], b: number[]) => a.map((v, d) => v - b[d]);
  const dot = (a: number[], b: number[]) => a.reduce((s, v, d) => s + v * b[d], 0);
  const cross = (a: number[], b: number[]) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const first = sub(polygon[1], polygon[0]);
  const along = first.map((v, d) => v - dot(first, normal) * normal[d]);
  const x = along.map((v) => v / Math.hypot(...along));
  const y = cross(normal, x);
  const flat = polygon.map((p) => [dot(sub(p, polygon[0]), x), -dot(sub(p, polygon[0]), y)]);
  const xs = flat.map((p) => p[0]);
  const ys = flat.map((p) => p[1]);
  const [x0, x1, y0, y1] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  const scale = 120 / Math.max(x1 - x0, y1 - y0);
  const px = flat.map(([a, b]) => [(a - (x0 + x1) / 2) * scale + 95, (b - (y0 + y1) / 2) * scale + 80]);
  const root = svg("svg", { viewBox: "0 0 190 160", class: "outline", role: "img", "aria-label": "Flat outline" });
  root.append(svg("polygon", { points: px.map((p) => p.join(",")).join(" ") }));
  px.forEach((p, i) => {
    const q = px[(i + 1) % px.length];
    const m = [(p[0] + q[0]) / 2, (p[1] + q[1]) / 2];
    const away = [m[0] - 95, m[1] - 80];
    const reach = 13 / (Math.hypot(away[0], away[1]) || 1);
    const length = Math.hypot(...sub(polygon[(i + 1) % px.length], polygon[i]));
    root.append(svg("text", { x: m[0] + away[0] * reach, y: m[1] + away[1] * reach + 3, "text-anchor": "middle" }, number(length)));
  });
  return root;
}
