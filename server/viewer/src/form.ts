// The form of a request, made from the server's description of its settings (GET /v1/settings, a JSON Schema).
// The settings are one object that holds every setting; controls read it and write into it, so none is lost.

export type Json = null | boolean | number | string | Json[] | { [name: string]: Json };
export type Settings = { [name: string]: Json };

export interface Schema {
  type?: string;
  properties?: Record<string, Schema>;
  anyOf?: Schema[];
  enum?: string[];
  const?: string;
  items?: Schema;
  minItems?: number;
  maxItems?: number;
  minimum?: number;
  exclusiveMinimum?: number;
  default?: Json;
  title?: string;
  description?: string;
  unit?: string;
  rare?: boolean;
}

/** Settings that are moved rather than typed: least, greatest and step of the slider. */
const SLIDERS: Record<string, [number, number, number]> = { "pattern.around": [6, 160, 2], "panels.sizes": [1, 40, 1] };
/** Settings of which a request gives one; a choice shows one of them. */
const ALTERNATIVES: Record<string, string[]> = { pattern: ["around", "edge_length"] };

export function element<T extends HTMLElement = HTMLElement>(tag: string, attributes: Record<string, string> = {}, ...children: (Node | string)[]): T {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...children);
  return node as T;
}

// ---------------------------------------------------------------- reading the description

const variants = (schema: Schema) => schema.anyOf ?? [schema];
const section = (schema: Schema) => variants(schema).find((part) => part.properties);
const numberIn = (schema: Schema) => variants(schema).find((part) => part.type === "number" || part.type === "integer");
const isNullable = (schema: Schema) => variants(schema).some((part) => part.type === "null");
const words = (schema: Schema) => variants(schema).flatMap((part) => part.enum ?? (part.const === undefined ? [] : [part.const]));
/** How many numbers a setting takes, 0 where it is something else. */
const tuple = (schema: Schema) => variants(schema).find((part) => part.type === "array" && part.items?.type === "number" && part.minItems === part.maxItems)?.minItems ?? 0;

/** What a request means that does not mention the setting. */
function defaultOf(schema: Schema): Json {
  if (schema.default !== undefined) return structuredClone(schema.default);
  const inner = section(schema);
  return inner ? complete(inner, {}) : null;
}

/** The settings given, with the defaults of those that are not. */
export function complete(schema: Schema, given: Settings): Settings {
  const filled: Settings = { ...given };
  for (const [name, part] of Object.entries(schema.properties ?? {})) {
    const inner = section(part);
    if (!(name in given)) filled[name] = defaultOf(part);
    else if (inner && given[name] !== null) filled[name] = complete(inner, given[name] as Settings);
  }
  return filled;
}

/** Number of settings, sections included, that are not at their defaults. */
function changes(schema: Schema, value: Json): number {
  const inner = section(schema);
  if (inner && value && !(isNullable(schema) && defaultOf(schema) === null))
    return Object.entries(inner.properties!).reduce((sum, [name, part]) => sum + changes(part, (value as Settings)[name]), 0);
  return JSON.stringify(value) === JSON.stringify(defaultOf(schema)) ? 0 : 1;
}

// ---------------------------------------------------------------- the form

export class Form {
  settings: Settings;
  private readonly drawn: (() => void)[] = [];

  /** changed: called with the path of what a person has changed, and what it was. own: settings with an editor of their own, by path. */
  constructor(
    root: HTMLElement,
    private readonly schema: Schema,
    private readonly changed: (path: string, before: Json) => void,
    private readonly own: Record<string, HTMLElement>,
  ) {
    this.settings = complete(schema, {});
    for (const [name, part] of Object.entries(schema.properties!)) {
      if (name === "name") continue;
      if (section(part)) root.append(this.top(name, part));
      else this.add(root, name, part);
    }
    this.draw();
  }

  get(path: string): Json {
    return path.split(".").reduce<Json>((at, step) => (at as Settings | null)?.[step] ?? null, this.settings);
  }

  set(path: string, value: Json): void {
    const steps = path.split(".");
    const last = steps.pop()!;
    let at = this.settings;
    for (const step of steps) at = (at[step] ??= {}) as Settings;
    at[last] = value;
  }

  /** All of a request's settings; those that the description does not know are kept, too. */
  adopt(given: Settings): void {
    this.settings = complete(this.schema, structuredClone(given));
    this.draw();
  }

  /** Every control as the settings have it. */
  draw(): void {
    for (const draw of this.drawn) draw();
  }

  private change(path: string, value: Json): void {
    const before = this.get(path);
    this.set(path, value);
    this.draw();
    this.changed(path, before);
  }

  /** A section of the request: its heading, its settings, and the rare ones folded away. */
  private top(name: string, schema: Schema): HTMLElement {
    const body = element("div");
    const box = element<HTMLFieldSetElement>("fieldset", {}, this.heading(name, schema), body);
    this.fill(body, name, schema);
    this.drawn.push(() => (body.hidden = this.get(name) === null));
    if (!schema.rare) return box;
    return this.folded([box], `${schema.title}`, () => changes(schema, this.get(name)));
  }

  private heading(path: string, schema: Schema): HTMLElement {
    const title = schema.title ?? path;
    if (!isNullable(schema)) return element("legend", { title: schema.description ?? "" }, title);
    const box = element<HTMLInputElement>("input", { type: "checkbox", name: path });
    box.addEventListener("input", () => this.change(path, box.checked ? complete(section(schema)!, {}) : null));
    this.drawn.push(() => (box.checked = this.get(path) !== null));
    return element("legend", { title: schema.description ?? "" }, element("label", {}, box, title));
  }

  private fill(into: HTMLElement, path: string, schema: Schema): void {
    const parts = Object.entries(section(schema)!.properties!);
    const rare = element("div");
    for (const [name, part] of parts) this.add(part.rare && !schema.rare ? rare : into, `${path}.${name}`, part);
    const shown = parts.filter(([, part]) => part.rare && !schema.rare);
    if (!shown.length) return;
    const count = () => shown.reduce((sum, [name, part]) => sum + changes(part, this.get(`${path}.${name}`)), 0);
    into.append(this.folded([...rare.childNodes], "More", count));
  }

  /** Settings that are seldom changed; the summary says how many are. */
  private folded(inner: Node[], title: string, count: () => number): HTMLElement {
    const note = element("small");
    this.drawn.push(() => (note.textContent = count() ? `${count()} set` : ""));
    return element("details", {}, element("summary", {}, title, note), ...inner);
  }

  private add(into: HTMLElement, path: string, schema: Schema): void {
    const [owner, name] = [path.split(".").slice(0, -1).join("."), path.split(".").pop()!];
    const pair = ALTERNATIVES[owner];
    if (pair?.[0] === name) into.append(this.alternatives(owner, pair));
    if (this.own[path]) return into.append(this.own[path]);
    if (section(schema)) {
      const body = element("div", { class: "inner" });
      into.append(element("fieldset", {}, this.heading(path, schema), body));
      this.fill(body, path, { ...schema, rare: true });
      this.drawn.push(() => (body.hidden = this.get(path) === null));
      return;
    }
    const row = this.row(path, schema);
    if (pair?.includes(name)) this.drawn.push(() => (row.hidden = this.get(path) === null));
    into.append(row);
  }

  /** Which one of several settings is given; none: the server chooses. */
  private alternatives(owner: string, names: string[]): HTMLElement {
    const inner = section(this.schema.properties![owner])!.properties!;
    const select = element<HTMLSelectElement>("select", { name: `${owner}.size` },
      element("option", { value: "" }, "chosen for me"), ...names.map((name) => element("option", { value: name }, inner[name].title!.toLowerCase())));
    const given = () => names.find((name) => this.get(`${owner}.${name}`) !== null) ?? "";
    select.addEventListener("input", (event) => {
      event.stopPropagation();
      for (const name of names) this.set(`${owner}.${name}`, null);
      if (select.value) this.set(`${owner}.${select.value}`, this.suggestion(`${owner}.${select.value}`));
      this.draw();
      this.changed(`${owner}.${select.value}`, null);
    });
    this.drawn.push(() => (select.value = given()));
    return element("label", { class: "row" }, "Size by", select);
  }

  /** A number to begin with where a person asks for one; the page may know a better one. */
  suggestion = (path: string): number => (path === "pattern.around" ? 48 : 1);

  private row(path: string, schema: Schema): HTMLElement {
    const title = schema.title ?? path;
    const attributes = { class: "row", title: schema.description ?? "" };
    if (schema.type === "boolean") {
      const box = element<HTMLInputElement>("input", { type: "checkbox", name: path });
      box.addEventListener("input", () => this.change(path, box.checked));
      this.drawn.push(() => (box.checked = this.get(path) === true));
      return element("label", { ...attributes, class: "row check" }, box, title);
    }
    if (tuple(schema)) return element("div", attributes, title, this.numbers(path, schema));
    if (numberIn(schema)) {
      if (SLIDERS[path]) return this.slider(path, schema, title);
      if (words(schema).length) return element("div", attributes, title, this.choice(path, schema), this.number(path, schema));
      return element("label", attributes, title, this.number(path, schema));
    }
    if (words(schema).length) return element("label", attributes, title, this.choice(path, schema));
    return element("label", { ...attributes, class: "row wide" }, title, this.text(path));
  }

  /** Words, and where numbers are accepted as well, a word that stands for them. */
  private choice(path: string, schema: Schema): HTMLElement {
    const list = [...(numberIn(schema) ? [["#", schema.unit ?? "number"]] : []), ...words(schema).map((word) => [word, word])];
    if (isNullable(schema)) list.push(["", "none"]);
    const select = element<HTMLSelectElement>("select", { name: numberIn(schema) ? `${path}.choice` : path, "aria-label": schema.title ?? path },
      ...list.map(([value, text]) => element("option", { value }, text)));
    select.addEventListener("input", () => this.change(path, select.value === "#" ? (numberIn(schema)!.minimum ?? 0) : select.value || null));
    this.drawn.push(() => {
      const value = this.get(path);
      select.value = typeof value === "number" ? "#" : String(value ?? "");
    });
    return select;
  }

  private number(path: string, schema: Schema): HTMLInputElement {
    const limits = numberIn(schema)!;
    const least = limits.minimum ?? limits.exclusiveMinimum;
    const input = element<HTMLInputElement>("input", { type: "number", name: path, step: limits.type === "integer" ? "1" : "any", "aria-label": schema.title ?? path, ...(least === undefined ? {} : { min: String(least) }) });
    if (isNullable(schema)) input.placeholder = "none";
    input.addEventListener("input", () => {
      if (input.value === "" ? !isNullable(schema) || !input.validity.valid : false) return; // being typed
      this.change(path, input.value === "" ? null : Number(input.value));
    });
    this.drawn.push(() => {
      const value = this.get(path);
      input.hidden = words(schema).length > 0 && typeof value !== "number";
      if (document.activeElement !== input || Number(input.value) !== value) input.value = value === null ? "" : String(value);
    });
    return input;
  }

  private slider(path: string, schema: Schema, title: string): HTMLElement {
    const [least, most, step] = SLIDERS[path];
    const input = element<HTMLInputElement>("input", { type: "range", name: path, min: String(least), step: String(step), "aria-label": title });
    const shown = element("output");
    const others = words(schema).length ? [this.choice(path, schema)] : [];
    input.addEventListener("input", () => this.change(path, Number(input.value)));
    this.drawn.push(() => {
      const value = this.get(path);
      input.hidden = typeof value !== "number";
      shown.textContent = typeof value === "number" ? String(value) : "";
      if (typeof value !== "number") return;
      input.max = String(Math.max(most, value));
      input.min = String(Math.min(least, value));
      input.step = (value - least) % step ? "1" : String(step);
      input.value = String(value);
    });
    return element("div", { class: "slide", title: schema.description ?? "" }, title, ...others, shown, input);
  }

  /** Several numbers beside each other; none at all where that is allowed. */
  private numbers(path: string, schema: Schema): HTMLElement {
    const inputs = Array.from({ length: tuple(schema) }, (_, i) =>
      element<HTMLInputElement>("input", { type: "number", step: "any", name: `${path}.${i}`, "aria-label": `${schema.title} ${i + 1}` }));
    for (const input of inputs)
      input.addEventListener("input", () => {
        const filled = inputs.filter((one) => one.value !== "").length;
        if (filled === inputs.length) this.change(path, inputs.map((one) => Number(one.value)));
        else if (!filled && isNullable(schema)) this.change(path, null);
      });
    this.drawn.push(() => {
      if (inputs.includes(document.activeElement as HTMLInputElement)) return;
      const value = this.get(path) as number[] | null;
      inputs.forEach((input, i) => (input.value = value ? String(value[i]) : ""));
    });
    return element("span", { class: "numbers" }, ...inputs);
  }

  /** Anything else as JSON: what has no control of its own yet can still be read and changed. */
  private text(path: string): HTMLElement {
    const input = element<HTMLTextAreaElement>("textarea", { name: path, rows: "1", spellcheck: "false" });
    input.addEventListener("input", (event) => {
      event.stopPropagation();
      try {
        const value = JSON.parse(input.value || "null") as Json;
        input.classList.remove("wrong");
        this.set(path, value);
        this.changed(path, null);
      } catch {
        input.classList.add("wrong");
      }
    });
    this.drawn.push(() => {
      if (document.activeElement !== input) input.value = JSON.stringify(this.get(path));
    });
    return input;
  }
}
