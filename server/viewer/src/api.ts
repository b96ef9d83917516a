// The wire contract as this page uses it: types, and one function per route.
import type { Schema } from "./form";

export type Vec2 = [number, number];
export type Vec3 = [number, number, number];

export interface Problem {
  type: string;
  title: string;
  status: number;
  detail: string;
  errors?: { pointer: string; detail: string }[];
  vertices?: number[];
  faces?: number[];
  edges?: [number, number][];
  objects?: FileObject[];
}

export interface Job {
  id: string;
  name: string | null;
  status: "queued" | "running" | "done" | "failed" | "cancelled";
  stage: string | null;
  progress: number;
  created: string;
  timings: Record<string, number>;
  problem: Problem | null;
  kind?: "solve" | "explore";
}

export interface Figures {
  uncovered: number;
  panels: number;
  types: number;
  cost: number;
  gap_max: number | null;
  /** Share of the surface without cells. */
  bare: number;
}

export interface Variant {
  request: Request;
  predicted: Figures;
  measured: Figures | null;
  front: boolean;
}

/** What an exploration found. */
export interface Variants {
  variants: Variant[];
  front: number[];
  best: number | null;
  /** All that were measured, the one to propose first; not there in what older servers found. */
  ranking?: number[];
  notes: string[];
}

export interface BoundaryAngle {
  vertex?: number;
  point?: Vec3;
  angle: number;
}

export interface Request {
  name?: string;
  surface: Record<string, unknown>;
  [setting: string]: unknown;
}

export interface TradeOff {
  sizes: number[];
  uncovered: number[];
  worst_gap: number[];
  /** how many the panels have */
  taken: number;
}

/** What numbers of singularities leave uncovered; at: where they would stand. */
export interface SingularityCurve {
  sizes: number;
  taken: number;
  coarse: boolean;
  number: number[];
  uncovered: number[];
  scale_ratio: number[];
  at: { point: Vec3; index: number }[][];
}

export interface Result {
  unit: string | null;
  mesh: { vertices: Vec3[]; faces: number[][]; input_vertex: number[]; vertex_of_input: number[]; loops: number[][]; repairs: string[]; features: number[][] };
  map: {
    kind: string;
    /** The six that follow describe cylinders and cones; they are null on nets, whose corners say it all. */
    cone_angle: number | null;
    uv: Vec2[] | null;
    sheet: number[][] | null;
    deck: { angle: number; translation: Vec2 } | null;
    apex: Vec2 | null;
    circumference: number | null;
    corners?: Vec2[][] | null;
    cones: { vertex: number; index: number; moved: number }[];
    log_scale: number[];
    boundary_angles: number[][];
    iterations: number;
    residual: number;
    flips: number;
    /** Of a domain that overlaps itself: the pieces to draw it in, and by how much to move each. */
    apart?: { face: number[]; cell: number[] | null; shift: Vec2[] } | null;
  };
  pattern?: {
    kind: string;
    vertices: Vec3[];
    normals: Vec3[];
    uv: Vec2[];
    faces: number[][];
    sheet?: number[][] | null;
    corners?: Vec2[][] | null;
    index?: number[];
    whole: boolean[];
    neighbours: number[][];
    rings: number;
    around: number;
    distortion: number;
    notes?: string[];
  } | null;
  panels?: {
    polygons: Vec3[][];
    face: number[];
    label: string[];
    size: number[];
    edge_length: number[];
    center: Vec3[];
    normal: Vec3[];
    whole: boolean[];
    planarity?: (number | null)[] | null;
    surface_distance?: (number | null)[] | null;
    gap_tangential?: (number | null)[] | null;
  } | null;
  sizes?: { size: number; edge_length: number; count: number; color: string }[] | null;
  support?: { nodes: Vec3[]; axes: Vec3[]; edges: [number, number][]; strips: Vec3[][] } | null;
  quality: Record<string, any> & { trade_off?: TradeOff | null; singularity_curve?: SingularityCurve | null };
  timings?: Record<string, number>;
}

export class ProblemError extends Error {
  constructor(readonly problem: Problem) {
    super(problem.detail || problem.title);
  }
}

/** The server did not answer at all (stopped, restarting), or is too busy to; wait: after so many ms it may. */
export class UnreachableError extends Error {
  constructor(message: string, readonly wait = 700) {
    super(message);
  }
}

/** Asks again while the server is away. */
export async function untilReached<T>(ask: () => Promise<T>, tell: (error: UnreachableError) => void): Promise<T> {
  for (;;) {
    try {
      return await ask();
    } catch (error) {
      if (!(error instanceof UnreachableError)) throw error;
      tell(error);
      await new Promise((resolve) => setTimeout(resolve, error.wait));
    }
  }
}

/** Secret of a server that was started with --token; kept for the visit only. */
let token = sessionStorage.getItem("hexwrap-token") ?? "";

async function call(path: string, init: RequestInit = {}): Promise<Response> {
  let response: Response;
  try {
    const headers = new Headers(init.headers);
    if (token) headers.set("Authorization", `Bearer ${token}`);
    response = await fetch(path, { ...init, headers });
  } catch {
    throw new UnreachableError("The server does not answer. Is hexwrap serve running?");
  }
  if (response.ok) return response;
  if (response.status === 401 && askForToken()) return call(path, init);
  const kind = response.headers.get("content-type") ?? "";
  const problem: Problem = kind.includes("json")
    ? await response.json()
    : { type: "about:blank", title: response.statusText, status: response.status, detail: `The server answered ${response.status}.` };
  const seconds = Number(response.headers.get("retry-after"));
  if (response.status === 503 && (init.method ?? "GET") === "GET") throw new UnreachableError(problem.detail, 1000 * (seconds || 1));
  throw new ProblemError(problem);
}

let asked = false;
/** Asks once per visit; the answer is tried for everything that follows. */
function askForToken(): boolean {
  if (asked) return false;
  asked = true;
  token = prompt("This server asks for its token (the one it was started with):") ?? "";
  sessionStorage.setItem("hexwrap-token", token);
  return token !== "";
}

/** Server-sent events until the job is over; a browser's own reader would ask for them without the token. */
const OVER = ["done", "failed", "cancelled"];
async function* events(path: string): AsyncGenerator<{ name: string; data: any }> {
  const reader = (await call(path)).body!.pipeThrough(new TextDecoderStream()).getReader();
  let text = "";
  try {
    while (true) {
      const { value, done } = await reader.read().catch(() => ({ value: "", done: true }));
      if (done) throw new UnreachableError("The server stopped; what it has found so far is kept.");
      const blocks = (text + value).split("\n\n");
      text = blocks.pop()!;
      for (const block of blocks) {
        const found = /^event: (.*)\ndata: (.*)$/.exec(block);
        if (found) yield { name: found[1], data: JSON.parse(found[2]) };
        if (found && OVER.includes(found[1])) return;
      }
    }
  } finally {
    void reader.cancel();
  }
}

const json = async <T>(path: string, init?: RequestInit): Promise<T> => (await call(path, init)).json() as Promise<T>;

const post = (body: unknown): RequestInit => ({
  method: "POST",
  headers: { "Content-Type": "application/json" },
  body: JSON.stringify(body),
});

/** An object of an uploaded file, as POST /v1/surfaces lists them. */
export interface FileObject { id: string; name: string; layer: string; kind: string; visible: boolean; size: Vec3; used: boolean }
export interface Stored { id: string; vertices: number; faces: number; repairs: string[]; unit?: string | null; objects?: FileObject[] }

/** The surface sent last, and how to send it again: the server keeps surfaces for a while only. */
let latest: { id: string; send: () => Promise<Stored> } | null = null;

async function store(send: () => Promise<Stored>): Promise<Stored> {
  const stored = await send();
  latest = { id: stored.id, send };
  return stored;
}

/** Sends the surface that goes by this id again, where the page has it; whether it has. */
async function again({ id }: Request["surface"]): Promise<boolean> {
  if (latest === null || id !== latest.id) return false;
  await latest.send();
  return true;
}

/** A job; where its surface is kept no more, once again with it. */
async function start(path: string, body: Request): Promise<Job> {
  try {
    return await json<Job>(path, post(body));
  } catch (error) {
    const lost = error instanceof ProblemError && error.problem.errors?.some(({ pointer }) => pointer === "/surface/id");
    if (!lost || !(await again(body.surface))) throw error;
    return json<Job>(path, post(body));
  }
}

export const api = {
  health: () => json<{ status: string; version: string }>("/health"),
  jobs: () => json<{ jobs: Job[] }>("/v1/jobs?limit=50").then((answer) => answer.jobs),
  job: (id: string, wait = 0) => json<Job>(`/v1/jobs/${id}${wait ? `?wait=${wait}` : ""}`),
  submit: (request: Request) => start("/v1/jobs", request),
  explore: (body: Request) => start("/v1/explore", body),
  events: (id: string) => events(`/v1/jobs/${id}/events`),
  variants: (id: string) => json<Variants>(`/v1/jobs/${id}/result`),
  /** The finished work as a file, through the token where there is one. */
  file: (id: string, name: string) => call(`/v1/jobs/${id}/files/${name}`).then((answer) => answer.blob()),
  cancel: (id: string) => call(`/v1/jobs/${id}`, { method: "DELETE" }),
  /** include: the parts that are wanted; all unless given. */
  result: (id: string, include?: readonly string[]) =>
    json<Partial<Result>>(`/v1/jobs/${id}/result${include ? `?include=${include.join(",")}` : ""}`),
  request: (id: string) => json<Request>(`/v1/jobs/${id}/request`),
  settings: () => json<Schema>("/v1/settings"),
  samples: () => json<{ samples: { name: string }[] }>("/v1/samples").then((answer) => answer.samples),
  sample: (name: string) => json<Request>(`/v1/samples/${name}`),
  /** A surface of a request, to be named by its id from then on. */
  store: (surface: Request["surface"]) => store(() => json<Stored>("/v1/surfaces", post(surface))),
  /** The file's mesh as it stands, unchecked: to have something to point at when it is refused. */
  preview: (file: File) => json<{ vertices: Vec3[]; faces: number[][] }>("/v1/surfaces/preview", upload(file)),
  /** object: id of the one that is meant, where the file holds several. */
  surface: (file: File, object?: string) => store(() => json<Stored>("/v1/surfaces", upload(file, object))),
  again,
};

function upload(file: File, object?: string): RequestInit {
  const form = new FormData();
  if (object !== undefined) form.append("object", object);
  form.append("file", file, file.name);
  return { method: "POST", body: form };
}

export const FILES = [
  "panels.obj", "panels.3dm", "panels.dxf", "panels.csv",
  "panels.ifc", "panels.glb", "cutting-list.csv", "flat.dxf",
  "domain.svg", "domain.dxf", "panels.png", "result.json", "result.npz",
];
