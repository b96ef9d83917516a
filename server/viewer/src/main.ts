// The page: reads settings, submits jobs, shows results. All state stands in one object; draw functions read it.
import { balance, choices, close, loopOf, type Corner } from "./angles";
import { api, FILES, ProblemError, UnreachableError, untilReached, type BoundaryAngle, type FileObject, type Job, type Problem, type Request, type Result, type Vec3 } from "./api";
import { flatOutline, histogram, singularityCurve, tradeOff } from "./charts";
import { collected, colour, MODES, number, RAMP_CSS, regular, type Legend, type Mode } from "./colors";
import { DomainView } from "./domain";
import { Explorer } from "./explore";
import { LineDrawing, without, type Features } from "./features";
import { complete, element, Form, type Json, type Schema, type Settings } from "./form";
import { View3D } from "./view3d";

const $ = <T extends HTMLElement = HTMLElement>(id: string) => document.getElementById(id) as T;
const page = $<HTMLFormElement>("form");
/** Every setting of the request; made when the server has described them. */
let form: Form;
let description: Schema;

interface State {
  surface: Request["surface"] | null;
  name: string;
  job: Job | null;
  result: Result | null;
  request: Request | null;
  selected: number | null;
  mode: Mode;
  /** counts submissions, so that an answer to an older one is dropped */
  turn: number;
}

const state: State = {
  surface: null, name: "", job: null, result: null, request: null, selected: null, mode: "size", turn: 0,
};
const space = new View3D($("view3d"));
const domain = new DomainView($("domain"));

/** Variants of the surface that is worked on, with what of the settings does not vary. */
const explorer = new Explorer($("variants"), () => {
  if (!state.surface) {
    note("Choose a sample or drop a file first.", true);
    return null;
  }
  const { name, surface, pattern, panels } = currentRequest();
  const split = panels && (panels as Settings).mode === "split" ? { panels } : {};
  return { name, surface, ...(pattern ? { pattern: { ...pattern, around: null, edge_length: null } } : {}), ...split };
}, (request) => {
  adopt(request);
  void solve();
});

// ---------------------------------------------------------------- settings and submission

/** All settings, those of the surface beside it. */
function currentRequest(): Request {
  const { surface, ...others } = structuredClone(form.settings);
  const { mesh, ...beside } = (surface ?? {}) as Settings;
  const sizes = mesh && !("vertices" in state.surface!) ? { mesh } : {}; // a mesh is as fine as it is
  return { ...others, name: state.name, surface: { ...state.surface!, ...beside, ...sizes } };
}

/** Beams as deep as a third of a mean edge: visible, and in proportion. */
const supportDepth = () => meanEdge() / 3;

/** Of the panels shown; 1 where there are none. */
function meanEdge(): number {
  const lengths = state.result?.panels?.edge_length;
  return lengths?.length ? lengths.reduce((a, b) => a + b, 0) / lengths.length : 1;
}

/** Takes over a whole request: what it does not say has its default. */
function adopt(request: Request): void {
  $("objects").hidden = true;
  const { surface, name, ...settings } = request;
  const known = description.properties!.surface;
  const own = Object.keys(known.anyOf?.find((part) => part.properties)?.properties ?? {});
  const beside = Object.entries(surface).filter(([key]) => own.includes(key));
  state.surface = Object.fromEntries(Object.entries(surface).filter(([key]) => !own.includes(key)));
  state.name = name ?? "";
  form.adopt({ ...settings, surface: beside.length ? Object.fromEntries(beside) : null } as Settings);
  drawForm();
}

/** The corners asked for, where the shown surface has them. */
function corners(): Corner[] {
  const { result } = state;
  const unit = perHalfTurn();
  return entries().map(({ vertex, point, angle }) => {
    const at = !result ? null : point ? nearestOnBoundary(result, point) : (result.mesh.vertex_of_input[vertex!] ?? -1);
    const known = at !== null && at >= 0;
    return { point: known ? result!.mesh.vertices[at] : (point ?? null), loop: known ? loopOf(result!, at) : null, angle: angle / unit };
  });
}

const entries = () => form.get("boundary.angles") as unknown as BoundaryAngle[];
type Unit = "rad" | "deg" | "pi";
/** 180° in each unit of angles. */
const HALF_TURN: Record<Unit, number> = { rad: Math.PI, deg: 180, pi: 1 };
const perHalfTurn = () => HALF_TURN[form.get("boundary.angle_unit") as Unit];
const byAngles = () => form.get("boundary.mode") === "angles";
const setEntries = (list: BoundaryAngle[]) => form.set("boundary.angles", list as unknown as Json);

function nearestOnBoundary(result: Result, point: Vec3): number {
  const all = result.mesh.loops.flat();
  return all.reduce((best, v) => (distance(result.mesh.vertices[v], point) < distance(result.mesh.vertices[best], point) ? v : best));
}

const distance = (p: number[], q: number[]) => Math.hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2]);

let waiting = 0;
/** Whether what was sent last is still worked on, or drawn. */
let busy = false;
/**
 * Sliders call this: the newest value wins. It is sent at once, or when the answer to the one before is drawn; where
 * that takes longer than the hand rests, its job is cancelled. Numbers that are typed wait for their last digit.
 */
function solveSoon(): void {
  if (!state.surface) return;
  clearTimeout(waiting);
  const rests = busy || document.activeElement?.matches("input[type=number], textarea");
  waiting = window.setTimeout(() => void solve(), rests ? 220 : 0);
}

async function solve(): Promise<void> {
  if (!state.surface) return note("Choose a sample or drop a file first.", true);
  clearTimeout(waiting);
  waiting = 0;
  busy = true;
  const turn = ++state.turn;
  const before = state.job;
  if (before && (before.status === "queued" || before.status === "running")) void api.cancel(before.id).catch(() => undefined);
  try {
    await sendMesh();
    if (turn !== state.turn) return;
    const request = currentRequest();
    const job = await api.submit(request);
    if (turn !== state.turn) return void api.cancel(job.id).catch(() => undefined);
    state.request = request;
    sent = basis(job.id, request);
    await follow(job, turn, sameSurface());
  } catch (error) {
    if (turn === state.turn) report(error);
  } finally {
    if (turn === state.turn) {
      busy = false;
      if (waiting) void solve();
    }
  }
}

/** A mesh is sent once, and then goes by its id as those of files do. */
async function sendMesh(): Promise<void> {
  const { surface } = state;
  if (!surface || !("vertices" in surface)) return;
  const stored = { id: (await api.store(surface)).id };
  if (shownSurface === surface) shownSurface = stored;
  if (state.surface === surface) state.surface = stored;
}

/** The surface that the shown result is of. */
let shownSurface: Request["surface"] | null = null;

/** Whether the shown result is of the surface that is being worked on; surfaces named by id are compared by it. */
function sameSurface(): boolean {
  const { surface } = state;
  return shownSurface !== null && surface !== null && (shownSurface === surface || (surface.id !== undefined && shownSurface.id === surface.id));
}

async function follow(job: Job, turn: number, keepView: boolean): Promise<void> {
  banner(null);
  const started = performance.now();
  while (job.status === "queued" || job.status === "running") {
    setJob(job);
    const { id } = job;
    job = await untilReached(() => api.job(id, performance.now() - started < 600 ? 0.15 : 0.4), away);
    if (turn !== state.turn) return;
  }
  setJob(job);
  void drawJobs();
  if (job.status === "failed" && job.problem) throw new ProblemError(job.problem);
  if (job.status !== "done") {
    if (!sameSurface()) forget();
    return note(`This job was ${job.status}.`);
  }
  const [before, parts] = [state.result, missing(job)];
  const result = { ...(parts === DRAWN ? {} : before), ...(await api.result(job.id, parts)) } as Result;
  if (turn !== state.turn) return;
  shown = sent?.id === job.id ? sent : null;
  present(job, result, keepView);
}

/** The parts of a result that are drawn, those that change with the pattern, and with the panels alone. */
const OF_PANELS = ["panels", "sizes", "quality", "support", "timings"] as const;
const OF_PATTERN = ["pattern", ...OF_PANELS] as const;
const DRAWN = ["unit", "mesh", "map", ...OF_PATTERN] as const;

/** A job, and what its map and its pattern follow from, but the surface; "" where the sizes count, too. */
interface Sent { id: string; map: string; pattern: string }

/** The one sent last, and the one on the screen. */
let sent: Sent | null = null;
let shown: Sent | null = null;

function basis(id: string, { surface, boundary, pattern, panels, singularities }: Request): Sent {
  const text = (value: unknown) => (singularities ? "" : JSON.stringify(value, (key, part) => (key === "nurbs" ? undefined : part)));
  const asked = (pattern as Settings | null)?.kind;
  const kind = [asked, asked === "auto" && (panels as Settings | null)?.mode]; // auto: another one for watertight panels
  return { id, map: text({ surface, boundary, kind }), pattern: text({ surface, boundary, pattern, kind }) };
}

/** The parts of a job's result that differ from those on the screen. A map that overlaps itself says where cells lie. */
function missing(job: Job): readonly (keyof Result)[] {
  const map = state.result?.map;
  if (!map || map.cones.length || !sameSurface() || sent?.id !== job.id || !sent.map || sent.map !== shown?.map) return DRAWN;
  if (sent.pattern === shown.pattern) return OF_PANELS;
  return map.apart ? DRAWN : OF_PATTERN;
}

/** Nothing to look at any more: what comes next is of another surface. */
function forget(): void {
  state.result = null;
  state.selected = null;
  shownSurface = null;
  delete document.documentElement.dataset.shown;
  drawing.cancel();
  space.clear();
  domain.clear();
  drawResult();
}

/** Everything beside the two views. */
function drawResult(): void {
  drawColours();
  drawCharts();
  drawQuality();
  drawCard();
  drawFiles();
  drawAngles();
}

function setJob(job: Job): void {
  state.job = job;
  const busy = job.status === "queued" || job.status === "running";
  $("cancel").hidden = !busy;
  $("progress").hidden = !busy;
  ($("progress").firstElementChild as HTMLElement).style.width = `${100 * job.progress}%`;
  $("progress").lastElementChild!.textContent = job.status === "queued" ? "queued" : `${job.stage ?? "working"} · ${Math.round(100 * job.progress)} %`;
}

async function cancel(): Promise<void> {
  state.turn++;
  busy = false;
  clearTimeout(waiting);
  waiting = 0;
  if (state.job) await api.cancel(state.job.id).catch(report);
  if (state.job) setJob({ ...state.job, status: "cancelled" });
  note("Cancelled.");
  void drawJobs();
}

function present(job: Job, result: Result, keepView: boolean): void {
  markFeature(null);
  shownFeatures = featuresOf(state.request?.surface as Json);
  state.result = result;
  state.selected = null;
  shownSurface = state.surface;
  location.hash = `job/${job.id}`;
  banner(null);
  note([...(result.mesh.repairs ?? []), ...(result.quality?.notes ?? [])].join("\n"));
  space.show(result, keepView);
  domain.show(result, keepView);
  toggles();
  if (drawing.on) drawing.start(); // what was begun stood on what is gone
  drawResult();
  document.documentElement.dataset.shown = job.id;
}

// ---------------------------------------------------------------- surfaces: files and samples

async function takeFile(file: File, object?: string): Promise<void> {
  const turn = ++state.turn;
  await described; // files may be dropped before
  if (turn !== state.turn) return;
  if (object === undefined) drawObjects(file, []);
  state.surface = null;
  explorer.clear();
  const sample = $<HTMLSelectElement>("sample");
  if (sample.value) form.adopt({}); // what a sample was made for goes with it
  sample.value = "";
  forgetPlaces();
  drawForm();
  state.name = file.name.replace(/\.[^.]*$/, "");
  note(`Reading ${file.name} …`);
  try {
    const stored = await api.surface(file, object);
    if (turn !== state.turn) return;
    state.surface = { id: stored.id };
    drawObjects(file, stored.objects ?? [], stored.unit);
    note(`${stored.vertices} vertices, ${stored.faces} faces. ${stored.repairs.join(" ")}`);
    await solve();
  } catch (error) {
    if (turn !== state.turn) return;
    note("");
    report(error);
    if (error instanceof ProblemError) {
      if (error.problem.objects) drawObjects(file, error.problem.objects);
      await showFaults(file, error.problem, turn);
    }
  }
}

/** Corners, singularities and lines that were put at places of another surface. */
function forgetPlaces(): void {
  setEntries([]);
  if ((form.get("singularities.at") as Json[] | null)?.length) form.set("singularities", null);
  if (form.get("surface.features") !== null) form.set("surface.features", { ...askedFeatures(), lines: [], without: [] } as unknown as Json);
}

/** What a file holds, where that is more than one object: a click takes it alone. */
function drawObjects(file: File, objects: FileObject[], unit?: string | null): void {
  const list = $("objects");
  list.hidden = objects.length < 2;
  list.replaceChildren(...objects.map((object, i) => {
    const size = object.size.map((x) => number(x, 4)).join(" × ") + (unit ? ` ${unit}` : "");
    const where = [object.kind, object.layer, object.visible ? "" : "hidden or locked"].filter(Boolean).join(", ");
    const button = element("button", { class: object.visible ? "" : "dim", "aria-pressed": String(object.used), "data-object": object.id },
      element("span", {}, object.name || `object ${i}`), element("small", {}, `${where}: ${size}`));
    button.addEventListener("click", () => void takeFile(file, object.id));
    return element("li", {}, button);
  }));
}

/** The dropped mesh as it was sent, with the faulty vertices, edges and faces in red. */
async function showFaults(file: File, problem: Problem, turn: number): Promise<void> {
  try {
    const mesh = await api.preview(file);
    if (turn !== state.turn) return;
    forget();
    space.showMesh(mesh.vertices, mesh.faces, problem);
    document.documentElement.dataset.shown = "faults";
  } catch {
    if (turn === state.turn) forget(); // not even readable: the sentence stands alone
  }
}

async function takeSample(name: string): Promise<void> {
  if (!name) return;
  const turn = ++state.turn;
  try {
    const request = await api.sample(name);
    if (turn !== state.turn) return;
    explorer.clear();
    adopt({ ...request, name: request.name ?? name });
    await solve();
  } catch (error) {
    if (turn === state.turn) report(error);
  }
}

async function openJob(id: string): Promise<void> {
  const turn = ++state.turn;
  try {
    const [job, request] = await Promise.all([api.job(id), api.request(id)]);
    if (turn !== state.turn) return;
    if (job.kind === "explore") return await explorer.follow(job);
    state.request = request;
    $<HTMLSelectElement>("sample").value = "";
    adopt(request);
    await follow(job, turn, false);
  } catch (error) {
    if (turn === state.turn) report(error);
  }
}

// ---------------------------------------------------------------- telling

function note(text: string, error = false): void {
  const p = $("surface-note");
  p.textContent = text;
  p.classList.toggle("error", error);
}

function banner(text: string | null): void {
  $("banner").hidden = text === null;
  $("banner").textContent = text ?? "";
  delete $("banner").dataset.away;
}

/** Stands until the server answers again. */
function away({ message }: UnreachableError): void {
  banner(`${message} Trying again.`);
  $("banner").dataset.away = "yes";
}

function report(error: unknown): void {
  $("progress").hidden = true;
  $("cancel").hidden = true;
  if (state.result && !sameSurface()) forget();
  if (error instanceof ProblemError) {
    const where = error.problem.errors?.map((e) => e.detail).filter((d) => d !== error.problem.detail) ?? [];
    banner([error.problem.detail || error.problem.title, ...where.slice(0, 3)].join(" "));
    const { result } = state;
    const { vertices = [], faces = [], edges = [] } = error.problem;
    // A refusal by a job speaks of the sent mesh; where the last result knows it, show the faults on it.
    if (result && vertices.length + faces.length + edges.length) {
      const here = (v: number) => result.mesh.vertex_of_input[v] ?? -1;
      space.showMesh(result.mesh.vertices, result.mesh.faces, {
        ...error.problem, vertices: vertices.map(here), faces: [], edges: edges.map(([a, b]) => [here(a), here(b)]),
      });
    }
  } else banner(error instanceof Error ? error.message : String(error));
}

// ---------------------------------------------------------------- drawing the page

async function drawJobs(): Promise<void> {
  let jobs: Job[];
  try {
    jobs = await api.jobs();
  } catch (error) {
    if (error instanceof UnreachableError) away(error);
    return;
  }
  if ($("banner").dataset.away) banner(null);
  $("jobs").replaceChildren(...jobs.map((job) => {
    const busy = job.status === "running" || job.status === "queued";
    const seconds = Object.values(job.timings ?? {}).filter((t) => typeof t === "number").reduce((a, b) => a + b, 0);
    const button = element("button", { class: job.status, "aria-current": String(job.id === state.job?.id), "data-job": job.id },
      element("span", {}, job.name || job.id.slice(0, 8)), element("small", {}, job.status === "done" ? `${number(seconds, 2)} s` : job.status));
    if (busy) button.append(element("progress", { max: "1", value: String(job.progress) }));
    button.addEventListener("click", () => void openJob(job.id));
    return element("li", {}, button);
  }));
}

function drawForm(): void {
  form.draw();
  $("restore-features").hidden = !askedFeatures().without.length;
  const select = $<HTMLSelectElement>("angle-value");
  const chosen = select.value;
  select.replaceChildren(...choices(String(form.get("pattern.kind"))).map(({ value, label }) => element("option", { value: String(value) }, label)));
  if ([...select.options].some((o) => o.value === chosen)) select.value = chosen;
  drawAngles();
}

function drawAngles(): void {
  const on = byAngles();
  $("angles").hidden = !on;
  const { result } = state;
  const list = corners();
  const marked = new Set<number>();
  if (on && result)
    for (const { loop, point } of list)
      for (const v of loop === null ? [] : result.mesh.loops[loop]) if (isSame(result.mesh.vertices[v], point!)) marked.add(v);
  space.showBoundary(on && result ? result.mesh.vertices : null, result?.mesh.loops ?? [], marked);
  $("angle-list").replaceChildren(...list.map((c, i) => {
    const remove = element("button", { type: "button", "aria-label": `Remove corner ${i + 1}` }, "×");
    remove.addEventListener("click", () => {
      setEntries(entries().filter((_, k) => k !== i));
      drawForm();
      anglesChanged();
    });
    const where = c.loop !== null ? `on loop ${c.loop} ` : result ? "not on the boundary " : "";
    return element("li", {}, `${number(180 * c.angle)}° ${where}`, remove);
  }));
  const { loops, total } = balance(list, result);
  const closed = Math.abs(total) < 0.05;
  const sums = loops.map((sum, k) => `loop ${k} ${degrees(sum)}`).join(", ");
  $("balance").textContent = list.length ? `Σκ${sums && ": "}${sums}; ${closed ? "balanced" : `${degrees(total)} too much`}` : "";
  $("balance").classList.toggle("open", !closed);
}

/** Whether two places are one, to rounding. */
const isSame = (p: Vec3, q: Vec3) => distance(p, q) < 1e-9 * (1 + Math.hypot(...q));
const degrees = (x: number) => `${number(Math.round(1e4 * x) / 1e4)}°`;

function anglesChanged(): void {
  if (isBalanced()) solveSoon();
}

const isBalanced = () => Math.abs(balance(corners(), state.result).total) < 0.05;

function drawColours(): void {
  const { result } = state;
  if (!result?.panels) {
    $("legend").replaceChildren();
    return;
  }
  const { colors, legend } = colour(result, state.mode);
  space.paint(colors);
  domain.paint(colors);
  $("legend").replaceChildren(...legendNodes(legend));
}

function legendNodes(legend: Legend): Node[] {
  if (legend.kind === "none") return [element("span", {}, legend.text)];
  if (legend.kind === "classes")
    return [element("div", {}, legend.title), element("table", {}, ...legend.rows.map((row) => element("tr", {},
      element("td", {}, element("i", { style: `background:${row.color}` })), element("td", {}, row.label), element("td", {}, `× ${row.count}`))))];
  return [element("div", {}, legend.title), element("div", { class: "ramp", style: `background:${RAMP_CSS}` }),
    element("div", { class: "ends" }, element("span", {}, legend.low), element("span", {}, legend.high))];
}

function drawCharts(): void {
  const { result } = state;
  const curve = result?.quality.trade_off;
  $("histogram").replaceChildren(...(result?.sizes?.length ? [histogram(collected(result), regular(result.sizes, curve?.taken))] : []));
  $("curve").replaceChildren(...(curve ? [tradeOff(curve, chooseSizes)] : []));
  drawSingularities();
}

/** What other numbers of singularities would leave, where they were looked at or stand where they were put. */
function drawSingularities(): void {
  const { result } = state;
  const curve = result?.quality.singularity_curve;
  const several = curve && curve.number.length > 1 ? curve : null;
  const put = ((form.get("singularities") as Settings | null)?.at as Json[] | undefined)?.length ?? 0;
  $("singular").hidden = !several && !result?.map.cones.length;
  $("singular-curve").replaceChildren(...(several ? [singularityCurve(several, chooseSingularities)] : []));
  const note = $("singular-note");
  note.replaceChildren();
  if (several?.coarse) note.append("Roughly, with ends that are free.");
  else if (result?.map.cones.length) note.append("Drag one on the surface to another place; it then closes there again. ");
  if (put) {
    const button = element("button", { type: "button", id: "singular-auto" }, "Place them automatically");
    button.addEventListener("click", () => setSingularities({ count: "auto", at: [] }));
    note.append(button);
  }
}

function setSingularities(change: Settings): void {
  const before = form.get("singularities") as Settings | null;
  form.set("singularities", { ...before, ...change });
  drawForm();
  void solve();
}

function chooseSingularities(n: number): void {
  // The rough curve is of free ends; straight ones keep most of what it promises from coming true.
  if (state.result?.quality.singularity_curve?.coarse && form.get("boundary.mode") === "straight") form.set("boundary.mode", "isometric");
  setSingularities({ count: n, at: [] });
}

/** All stay where they are but the one that was dragged. */
function moveSingularity(i: number, to: Vec3): void {
  const { result } = state;
  if (!result) return;
  const at = result.map.cones.map(({ vertex, index }, k) => ({ point: k === i ? to : result.mesh.vertices[vertex], index }));
  setSingularities({ count: null, at });
}

function chooseSizes(k: number): void {
  form.set("panels.sizes", k);
  drawForm();
  void solve();
}

// ---------------------------------------------------------------- features: lines that the pattern follows

/** What a request asks for, defaults filled in. */
const featuresOf = (surface: Json) =>
  (complete(description, { surface: { ...(surface as Settings), features: (surface as Settings | null)?.features ?? {} } }).surface as Settings).features as unknown as Features;
const askedFeatures = () => featuresOf(form.settings.surface);
/** What the shown result was asked for with. */
let shownFeatures: Features | null = null;

function setFeatures(wanted: Features): Promise<void> {
  form.set("surface.features", wanted as unknown as Json);
  form.adopt(form.settings);
  drawForm();
  return solve();
}

/** While a newer result is on its way, what is on the screen is no longer what is asked for. */
function removeFeature(i: number): void {
  const { result, job } = state;
  const busy = job?.status === "queued" || job?.status === "running";
  if (result && shownFeatures && !busy) void setFeatures(without(shownFeatures, result, i));
}

/** A line that cannot be followed is taken back; why, stands in the banner. */
async function addLine(line: Vec3[]): Promise<void> {
  const before = askedFeatures();
  await setFeatures({ ...before, lines: [...before.lines, line] });
  if (state.job?.status !== "failed") return;
  form.set("surface.features", before as unknown as Json);
  drawForm();
}

const drawing = new LineDrawing((points, on) => {
  space.showSketch(points);
  $("view3d").classList.toggle("drawing", on);
  $("draw-line").setAttribute("aria-pressed", String(on));
  $("hint").hidden = !on;
  $("hint").textContent = points.length > 1
    ? "Double click or Enter: done. Click the first point: closed. Escape: cancel."
    : "Click points on the surface. Escape: cancel.";
}, (line) => void addLine(line));

function drawQuality(): void {
  const { result } = state;
  const rows: [string, string | Node][] = [];
  const widest = (gap: number, at: number | null) => {
    if (at === null) return number(gap, 3);
    const button = element("button", { type: "button", id: "widest", title: "Show the panel at the widest gap" }, `${number(gap, 3)} at ${result!.panels!.label[at]}`);
    button.addEventListener("click", () => {
      select(at);
      space.face(result!.panels!.normal[at]);
    });
    return button;
  };
  if (result) {
    const { map, pattern, panels, quality: q } = result;
    const loops = `${map.boundary_angles.length} loop${map.boundary_angles.length === 1 ? "" : "s"}`;
    const gaps = panels?.gap_tangential ?? [];
    const worst = gaps.reduce<number | null>((best, gap, i) => (gap !== null && (best === null || gap > gaps[best]!) ? i : best), null);
    const cone = map.cone_angle === null ? "" : `, ${number((180 * map.cone_angle) / Math.PI)}°`;
    rows.push(["Domain", map.kind === "net" ? `net with ${loops}` : map.kind === "cone" ? `cone${cone}` : "cylinder"]);
    if (map.cones.length) rows.push(["Singularities", String(map.cones.length)]);
    if (pattern) rows.push(["Pattern", `${pattern.around} around × ${pattern.rings} rings`], ["Distortion", number(pattern.distortion, 2)]);
    rows.push(["Scale ratio", number(q.scale_ratio)]);
    if (panels) rows.push(
      ["Panels", String(panels.face.length)], ["Planarity", number(q.planarity?.max, 2)], ["Overlaps", String(q.overlaps)],
      ["Coverage", `${number(100 * q.coverage)} %`], ["Gap (mean)", number(q.gap?.tangential?.mean, 3)], ["Gap (widest)", widest(q.gap?.tangential?.max, worst)],
      ["Distance (max)", number(q.surface_distance?.max, 3)], ["Distinct panels", String(q.distinct_panels)]);
    if (q.movement > 0) rows.push(["Convex", `${number(100 * q.convex)} %`], ["Moved (max)", number(q.movement, 3)]);
  }
  $("quality").replaceChildren(...rows.flatMap(([name, value]) => [element("dt", {}, name), element("dd", {}, value)]));
}

function drawCard(): void {
  const card = $("card");
  const { result, selected } = state;
  card.replaceChildren(element("h2", {}, "Panel"));
  const panels = result?.panels;
  if (!panels || selected === null) return void card.append(element("p", { class: "note" }, "Click a panel."));
  const facts: [string, string][] = [
    ["Label", panels.label[selected]], ["Size", panels.size[selected] < 0 ? "cut to fit" : String(panels.size[selected] + 1)],
    ["Edge", number(panels.edge_length[selected], 6)], ["Gap", number(panels.gap_tangential?.[selected], 3)],
    ["Planarity", number(panels.planarity?.[selected], 2)], ["Distance", number(panels.surface_distance?.[selected], 3)],
  ];
  const list = element("dl", {}, ...facts.flatMap(([name, value]) => [element("dt", {}, name), element("dd", {}, value)]));
  const figures = element("div", { class: "figures" }, list);
  figures.append(flatOutline(panels.polygons[selected], panels.normal[selected]));
  card.append(figures);
  const panelOf = new Map(panels.face.map((face, i) => [face, i]));
  const around = (result!.pattern?.neighbours[panels.face[selected]] ?? []).filter((f) => f >= 0).map((f) => panelOf.get(f)).filter((i) => i !== undefined);
  card.append(element("div", { class: "neighbours" }, "Neighbours ", ...around.map((i) => {
    const button = element("button", {}, panels.label[i]);
    button.addEventListener("click", () => select(i));
    return button;
  })));
}

function select(i: number | null): void {
  state.selected = i;
  space.select(i);
  domain.select(i);
  drawCard();
}

function hover(i: number | null): void {
  space.hover(i);
  domain.hover(i);
}

function drawFiles(): void {
  const { job, result } = state;
  $("files").replaceChildren(...(job && result ? FILES.map((name) => {
    const link = element("a", { href: `/v1/jobs/${job.id}/files/${name}`, download: name }, name);
    link.addEventListener("click", (event) => {
      event.preventDefault();
      void download(job.id, name);
    });
    return link;
  }) : []));
}

/** Fetched first, so that a refusal becomes a sentence on this page and not a file full of JSON. */
async function download(id: string, name: string): Promise<void> {
  try {
    const url = URL.createObjectURL(await api.file(id, name));
    const link = element("a", { href: url, download: name }) as HTMLAnchorElement;
    link.click();
    setTimeout(() => URL.revokeObjectURL(url), 10_000);
  } catch (error) {
    report(error);
  }
}

async function copy(text: string, what: string): Promise<void> {
  try {
    await navigator.clipboard.writeText(text);
    $("copied").textContent = `${what} copied.`;
  } catch {
    $("copied").textContent = text; // the clipboard may be closed to pages: show it, to be copied by hand
  }
}

/** The surface goes by its id, for a mesh is too long for a command; it is sent again, lest it is kept no more. */
async function copyCurl(): Promise<void> {
  const request = state.request ?? currentRequest();
  await api.again(request.surface).catch(() => undefined); // without a server it is for later
  const body = JSON.stringify(request).replace(/'/g, "'\\''");
  await copy(`curl -s ${location.origin}/v1/solve -H 'Content-Type: application/json' -d '${body}'`, "The request");
}

function asGrasshopper(): string {
  const { surface: _, name: __, ...settings } = state.request ?? currentRequest();
  return JSON.stringify(settings, null, 1);
}

// ---------------------------------------------------------------- wiring

function pointer(view: HTMLElement, pick: (x: number, y: number) => number | null, click: (x: number, y: number) => void): void {
  const canvas = view.querySelector("canvas")!;
  let down: { x: number; y: number } | null = null;
  let pending = 0;
  const here = (event: PointerEvent) => {
    const box = canvas.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  };
  canvas.addEventListener("pointerdown", (event) => (down = here(event)));
  canvas.addEventListener("pointerup", (event) => {
    const up = here(event);
    if (down && Math.hypot(up.x - down.x, up.y - down.y) < 4) click(up.x, up.y);
    down = null;
  });
  canvas.addEventListener("pointermove", (event) => {
    if (event.buttons) return;
    const { x, y } = here(event);
    cancelAnimationFrame(pending);
    pending = requestAnimationFrame(() => hover(pick(x, y)));
  });
  canvas.addEventListener("pointerleave", () => {
    hover(null);
    markFeature(null);
  });
}

function clickInSpace(x: number, y: number): void {
  const { result } = state;
  if (drawing.on) return drawing.add(space.pointAt(x, y), x, y);
  if (byAngles() && result) {
    const v = space.pickBoundary(x, y);
    if (v !== null) {
      const point = result.mesh.vertices[v];
      const angle = Number($<HTMLSelectElement>("angle-value").value);
      const others = corners();
      const kept = entries().filter((_, i) => !others[i].point || !isSame(others[i].point!, point));
      setEntries([...kept, { point, angle: angle * perHalfTurn() }]);
      drawForm();
      return anglesChanged();
    }
  }
  const feature = space.pickFeature(x, y);
  if (feature !== null) return removeFeature(feature);
  select(space.pick(x, y));
}

function clickInDomain(x: number, y: number): void {
  const feature = domain.pickFeature(x, y);
  if (feature !== null) removeFeature(feature);
  else select(domain.pick(x, y));
}

/** The panel under the pointer, unless it is over a feature: that is marked then, in both views. */
function overFeature(view: View3D | DomainView, x: number, y: number): number | null {
  const feature = drawing.on ? null : view.pickFeature(x, y);
  markFeature(feature);
  return feature === null ? view.pick(x, y) : null;
}

let marked: number | null = null;
function markFeature(i: number | null): void {
  if (i === marked) return;
  marked = i;
  for (const view of [space, domain]) {
    view.hoverFeature(i);
    view.element.classList.toggle("over-feature", i !== null);
    view.element.title = i === null ? "" : "Click to take this line out of the pattern";
  }
}

pointer($("view3d"), (x, y) => overFeature(space, x, y), clickInSpace);
space.onDrag = moveSingularity;
pointer($("domain"), (x, y) => overFeature(domain, x, y), clickInDomain);
$("view3d").querySelector("canvas")!.addEventListener("dblclick", () => drawing.on && drawing.finish());
$("draw-line").addEventListener("click", () => {
  if (drawing.on) drawing.cancel();
  else if (state.result) {
    drawing.start();
    $("view3d").querySelector("canvas")!.focus(); // Enter ends the line
  }
  else note("Choose a sample or drop a file first.", true);
});
$("restore-features").addEventListener("click", () => void setFeatures({ ...askedFeatures(), without: [] }));

page.addEventListener("submit", (event) => {
  event.preventDefault();
  void solve();
});

/** What a person has changed in the form. */
function settingChanged(path: string, before: Json): void {
  if (path === "boundary.angle_unit") // the angles stay what they are
    setEntries(entries().map((entry) => ({ ...entry, angle: (entry.angle / HALF_TURN[before as Unit]) * perHalfTurn() })));
  if (path === "boundary.mode" && !entries().length) form.set("boundary.angle_unit", byAngles() ? "deg" : "rad");
  const components = form.get("panels.components") as Settings | null;
  if (path === "support" && form.get("support") && !components?.depth && form.get("panels") !== null)
    form.set("panels.components", { inset: 0, thickness: 0, ...components, depth: supportDepth() });
  drawForm();
  if (!byAngles() || isBalanced()) solveSoon();
}

$("cancel").addEventListener("click", () => void cancel());
$("close-balance").addEventListener("click", () => {
  const [before, after] = [corners(), close(corners(), state.result)];
  const angle = (i: number) => Number((after[i].angle * perHalfTurn()).toPrecision(12));
  setEntries(entries().map((entry, i) => (after[i].angle === before[i].angle ? entry : { ...entry, angle: angle(i) })));
  drawForm();
  anglesChanged();
});
$("clear-angles").addEventListener("click", () => {
  setEntries([]);
  drawForm();
});

const drop = $("drop");
$<HTMLInputElement>("file").addEventListener("change", (event) => {
  const input = event.target as HTMLInputElement;
  if (input.files?.[0]) void takeFile(input.files[0]);
  input.value = "";
});
drop.addEventListener("keydown", (event) => {
  if (event.key === "Enter" || event.key === " ") $("file").click();
});
for (const type of ["dragover", "dragleave", "drop"] as const)
  document.addEventListener(type, (event) => {
    event.preventDefault();
    drop.classList.toggle("over", type === "dragover");
    const file = type === "drop" ? (event as DragEvent).dataTransfer?.files[0] : undefined;
    if (file) void takeFile(file);
  });
$<HTMLSelectElement>("sample").addEventListener("change", (event) => void takeSample((event.target as HTMLSelectElement).value));

$<HTMLSelectElement>("mode").append(...MODES.map(({ mode, label }) => element("option", { value: mode }, label)));
$<HTMLSelectElement>("mode").addEventListener("change", (event) => {
  state.mode = (event.target as HTMLSelectElement).value as Mode;
  drawColours();
});
const toggles = () => {
  const on = (name: string) => $<HTMLInputElement>(`t-${name}`).checked;
  space.toggle({ edges: on("edges"), labels: on("labels"), normals: on("normals"), supports: on("supports"), mesh: on("mesh"), features: on("features") });
  domain.showFeatures(on("features"));
};
for (const name of ["edges", "labels", "normals", "supports", "mesh", "features"]) $(`t-${name}`).addEventListener("change", toggles);
$("fit").addEventListener("click", () => {
  space.fit();
  domain.fit();
});
const cut = () => space.cut(Number($<HTMLSelectElement>("axis").value), Number($<HTMLInputElement>("cut").value));
$("cut").addEventListener("input", cut);
$("axis").addEventListener("change", cut);
$("copy-curl").addEventListener("click", () => void copyCurl());
$("copy-gh").addEventListener("click", () => void copy(asGrasshopper(), "The settings"));

document.addEventListener("keydown", (event) => {
  if ((event.target as HTMLElement).matches("input, select, textarea")) return;
  if ((event.ctrlKey && !event.altKey) || event.metaKey) return; // the browser's own; AltGr types brackets
  const count = state.result?.panels?.face.length ?? 0;
  if (event.key === "f" || event.key === "F") {
    space.fit();
    domain.fit();
  } else if (drawing.on && event.key === "Enter" && !(event.target as HTMLElement).matches("button, summary, a")) drawing.finish();
  else if (event.key === "Escape") {
    if (drawing.on) drawing.cancel();
    else if (!$("cancel").hidden) void cancel();
    else select(null);
  } else if (count && (event.key === "]" || event.key === "["))
    select(((state.selected ?? -1) + (event.key === "]" ? 1 : -1) + count) % count);
});

function theme(dark: boolean): void {
  document.documentElement.dataset.theme = dark ? "dark" : "light";
  try {
    localStorage.setItem("hexwrap-theme", dark ? "dark" : "light");
  } catch {
    // private windows may refuse storage; the theme then lasts for the visit
  }
}
$("theme").addEventListener("click", () => theme(document.documentElement.dataset.theme !== "dark"));

function storedTheme(): boolean {
  try {
    const stored = localStorage.getItem("hexwrap-theme");
    if (stored) return stored === "dark";
  } catch {
    // see theme()
  }
  return matchMedia("(prefers-color-scheme: dark)").matches;
}

/** Makes the form of what the server says can be set. */
async function describe(): Promise<void> {
  description = await untilReached(api.settings, away);
  form = new Form($("settings"), description, settingChanged, { "boundary.angles": $("angles") });
  form.suggestion = (path) => (path === "pattern.around" ? state.result?.pattern?.around ?? 48 : Number(meanEdge().toPrecision(3)));
  drawForm();
}

async function start(): Promise<void> {
  await described;
  const names = await api.samples().catch(() => []);
  $("sample").append(...names.map(({ name }) => element("option", { value: name }, name)));
  await drawJobs();
  setInterval(() => document.visibilityState === "visible" && void drawJobs(), 2000);
  const wanted = /^#job\/([\w-]+)$/.exec(location.hash);
  if (wanted) await openJob(wanted[1]);
  else if (names.length) note("Choose a sample, drop a file, or open a job.");
}

declare global {
  interface Window {
    hexwrapViewer: { space: View3D; domain: DomainView; state: State; corners: () => Corner[] };
  }
}
// For those who script the page (and for the tests): where things stand on the screen.
window.hexwrapViewer = { space, domain, state, corners };
theme(storedTheme());
const described = describe();
void start();
