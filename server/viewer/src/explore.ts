// Variants of the surface: a scatter of what they cost against what they leave open, with sliders for limits.
import { api, untilReached, type UnreachableError, type Figures, type Job, type Request, type Variant, type Variants } from "./api";
import { svg } from "./charts";
import { number } from "./colors";
import { element } from "./form";

const W = 340;
const H = 220;
const PAD = { left: 50, right: 10, top: 30, bottom: 34 };
/** Less that stays uncovered than this is drawn as this. */
const LEAST = 1e-5;

/** Of a share of the most types. */
const hue = (share: number) => `hsl(${250 - 200 * share} 65% 52%)`;

/** A variant in words. */
function said({ uncovered, bare, types, panels, gap_max, cost }: Figures): string {
  const joint = gap_max === null || gap_max === undefined ? "" : `, widest joint ${number(gap_max, 3)}`;
  return `${types} types, ${panels} panels, ${number(100 * uncovered, 3)} % uncovered, ${number(100 * bare, 2)} % of the surface without panels${joint}, cost ${Math.round(cost).toLocaleString("en")}`;
}

/** What a variant may be at most, to be shown as one that will do. */
const LIMITS: { name: "types" | "gap_max" | "panels"; label: string }[] = [
  { name: "types", label: "Types" },
  { name: "gap_max", label: "Widest joint" },
  { name: "panels", label: "Panels" },
];

export class Explorer {
  private found: Variants | null = null;
  /** Variants by their number, as they come. */
  private known: Variant[] = [];
  private frame = 0;
  private chosen: number | null = null;
  private turn = 0;
  private job: Job | null = null;
  private readonly limits: Partial<Record<(typeof LIMITS)[number]["name"], number>> = {};

  /** take: shows a variant. */
  constructor(private readonly root: HTMLElement, private readonly start: () => Request | null, private readonly take: (request: Request) => void) {
    this.draw();
  }

  /** Another surface: what was found is not of it. */
  clear(): void {
    this.turn++;
    this.found = this.job = this.chosen = null;
    this.known = [];
    this.draw();
  }

  async run(): Promise<void> {
    const body = this.start();
    if (body) await this.follow(await api.explore(body));
  }

  async follow(job: Job): Promise<void> {
    const turn = ++this.turn;
    this.found = this.chosen = null;
    this.known = [];
    this.job = job;
    this.draw();
    const tell = ({ message }: UnreachableError) => turn === this.turn && this.tell(`${message} Trying again.`);
    await untilReached(() => this.watch(job.id, turn), tell);
    if (turn !== this.turn) return;
    if (this.job?.status === "done") {
      const found = await untilReached(() => api.variants(job.id), tell);
      if (turn !== this.turn) return;
      this.found = found;
      this.known = found.variants;
      for (const { name } of LIMITS) delete this.limits[name];
    }
    this.draw();
  }

  /** Takes in what comes, until the job is over or another one counts. */
  private async watch(id: string, turn: number): Promise<void> {
    if (!this.busy || turn !== this.turn) return;
    for await (const { name, data } of api.events(id)) {
      if (turn !== this.turn) return;
      if (name === "variant") this.known[data.index] = data.variant;
      else this.job = data;
      this.soon();
    }
  }

  private get busy(): boolean {
    return this.job?.status === "queued" || this.job?.status === "running";
  }

  /** Draw what has come; the button stays the one that somebody may be pressing. */
  private soon(): void {
    this.frame ||= requestAnimationFrame(() => {
      this.frame = 0;
      if (!this.busy) return;
      const front = this.root.querySelector("svg.front");
      if (front) front.replaceWith(this.scatter());
      else if (this.known.length) this.root.lastElementChild!.before(this.scatter());
      this.tell(this.said());
    });
  }

  private tell(text: string): void {
    this.root.lastElementChild!.textContent = text;
  }

  private measured(): { index: number; figures: Figures }[] {
    return this.known.flatMap((one, index) => (one.measured ? [{ index, figures: one.measured }] : []));
  }

  private fits(figures: Figures): boolean {
    return LIMITS.every(({ name }) => (figures[name] ?? 0) <= (this.limits[name] ?? Infinity) * (1 + 1e-9));
  }

  /** The variant to propose: the first that keeps the limits. */
  private proposed(): number | null {
    const { found } = this;
    const ranking = found?.ranking ?? found?.front ?? [];
    return ranking.find((i) => this.fits(this.known[i].measured!)) ?? null;
  }

  /** What is proposed within the limits, and a button that shows it. */
  private proposal(): HTMLElement {
    const best = this.proposed();
    if (best === null) return element("p", { class: "note proposal" }, "No variant that was measured keeps these limits.");
    const button = element("button", { type: "button" }, "Show the proposed one");
    button.addEventListener("click", () => this.choose(best));
    return element("div", { class: "proposal" }, element("p", { class: "note" }, `Proposed: ${said(this.known[best].measured!)}.`), button);
  }

  private choose(index: number): void {
    this.chosen = index;
    this.draw();
    this.take(this.known[index].request);
  }

  private limited(): void {
    this.root.querySelector("svg.front")!.replaceWith(this.scatter());
    this.root.querySelector(".proposal")!.replaceWith(this.proposal());
  }

  private draw(): void {
    const busy = this.busy;
    const button = element("button", { type: "button", id: "explore" }, busy ? "Stop" : "Explore variants");
    button.addEventListener("click", () => {
      if (busy) void api.cancel(this.job!.id).finally(() => this.clear());
      else void this.run().catch((error: Error) => {
        this.job = null;
        this.draw();
        this.tell(error.message);
      });
    });
    const parts: (Node | string)[] = [element("div", { class: "buttons" }, button)];
    if (this.known.length) parts.push(this.scatter());
    if (this.found) parts.push(...this.sliders(), this.proposal());
    parts.push(element("p", { class: "note", role: "status" }, this.said()));
    this.root.replaceChildren(...parts);
  }

  private said(): string {
    if (this.busy) {
      const known = this.known.length ? ` · ${this.known.length} foreseen, ${this.measured().length} measured` : "";
      return `${this.job!.stage || "queued"} · ${Math.round(100 * this.job!.progress)} %${known}`;
    }
    if (this.job?.status === "failed") return this.job.problem?.detail ?? "The exploration failed.";
    return this.found ? this.found.notes.join(" ") : "Tries boundaries, singularities, sizes and their numbers, and shows what pays.";
  }

  private scatter(): SVGElement {
    const spots = this.known.map((one, index) => ({ one, index, figures: one.measured ?? one.predicted }));
    spots.sort((a, b) => Number(Boolean(a.one.measured)) - Number(Boolean(b.one.measured)));
    const root = svg("svg", { viewBox: `0 0 ${W} ${H}`, class: "front", "aria-label": "Variants: uncovered area over cost" });
    const costs = spots.map((s) => s.figures.cost);
    const open = spots.map((s) => Math.log(Math.max(s.figures.uncovered, LEAST)));
    const [c0, c1, u0, u1] = [Math.min(...costs), Math.max(...costs), Math.min(...open), Math.max(...open)];
    const types = spots.map((s) => s.figures.types);
    const [fewest, most] = [Math.min(...types), Math.max(...types, 1)];
    const x = (cost: number) => PAD.left + ((W - PAD.left - PAD.right) * (cost - c0)) / (c1 - c0 || 1);
    const y = (u: number) => H - PAD.bottom - ((H - PAD.top - PAD.bottom) * (u - u0)) / (u1 - u0 || 1);
    root.append(
      svg("line", { x1: PAD.left, x2: W - PAD.right, y1: H - PAD.bottom + 12, y2: H - PAD.bottom + 12, class: "axis" }),
      svg("text", { x: 0, y: 10 }, "uncovered"),
      svg("text", { x: W - PAD.right, y: 10, "text-anchor": "end" }, svg("tspan", { fill: hue(fewest / most) }, "● "), String(fewest), ...(most > fewest ? [" – ", svg("tspan", { fill: hue(1) }, "● "), String(most)] : []), " types"),
      svg("text", { x: PAD.left - 10, y: PAD.top + 4, "text-anchor": "end" }, `${number(100 * Math.exp(u1), 2)} %`),
      svg("text", { x: PAD.left - 10, y: H - PAD.bottom + 4, "text-anchor": "end" }, `${number(100 * Math.exp(u0), 2)} %`),
      svg("text", { x: PAD.left, y: H - 6 }, `cost ${Math.round(c0).toLocaleString("en")}`),
      svg("text", { x: W - PAD.right, y: H - 6, "text-anchor": "end" }, Math.round(c1).toLocaleString("en")),
    );
    const best = this.proposed();
    spots.forEach(({ one, index, figures }, i) => {
      const fill = hue(figures.types / most);
      const [cx, cy] = [x(figures.cost), y(open[i])];
      const words = said(figures);
      if (!one.measured) {
        root.append(svg("circle", { cx, cy, r: 2.2, fill, class: "foreseen" }, svg("title", {}, `Foreseen: ${words}`)));
        return;
      }
      const state = [index === this.chosen && "current", index === best && "best", !this.fits(figures) && "out"].filter(Boolean).join(" ");
      const spot = svg("circle", {
        cx, cy, r: one.front ? 6 : 3.2, fill, class: `variant ${state}`,
        tabindex: 0, role: "button", "data-variant": index, "aria-label": words,
      });
      spot.append(svg("title", {}, words));
      const take = () => this.choose(index);
      spot.addEventListener("click", take);
      spot.addEventListener("keydown", (event) => {
        if (!["Enter", " "].includes((event as KeyboardEvent).key)) return;
        event.preventDefault(); // a blank would scroll the page
        take();
        this.root.querySelector<SVGElement>(`[data-variant="${index}"]`)!.focus();
      });
      root.append(spot);
    });
    return root;
  }

  private sliders(): HTMLElement[] {
    return LIMITS.flatMap(({ name, label }) => {
      const values = this.measured().map((s) => s.figures[name] ?? 0);
      const [low, high] = [Math.min(...values), Math.max(...values)];
      if (!(high > low)) return [];
      const whole = name !== "gap_max";
      const now = this.limits[name] ?? high;
      const slider = element("input", {
        type: "range", min: String(low), max: String(high), step: whole ? "1" : "any", value: String(now), "data-limit": name,
      }) as HTMLInputElement;
      const shown = element("output", {}, `≤ ${number(now)}`);
      slider.addEventListener("input", () => {
        this.limits[name] = slider.valueAsNumber;
        shown.textContent = `≤ ${number(slider.valueAsNumber)}`;
        this.limited();
      });
      return [element("label", { class: "limit" }, label, slider, shown)];
    });
  }
}
