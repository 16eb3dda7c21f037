// Builds a form of labelled fields from the JSON schema of a request, reads the request back, and marks wrong fields.

import { typed, unreadable } from "./decimal.js";
import { readCells } from "./rows.js";
import { build } from "./shell.js";

let serial = 0;

/** A schema with its references resolved; `nullable` where null was one of its alternatives. */
function plain(schema, root) {
  if (schema.$ref) {
    const { $ref, ...rest } = schema;
    return plain({ ...root.$defs[$ref.split("/").at(-1)], ...rest }, root);
  }
  if (schema.allOf?.length === 1) return plain({ ...schema.allOf[0], ...schema, allOf: undefined }, root);
  const { anyOf, ...rest } = schema,
    kinds = (anyOf ?? []).filter((kind) => kind.type !== "null");
  if (anyOf && kinds.length < anyOf.length)
    return {
      ...plain(kinds.length === 1 ? { ...kinds[0], ...rest } : { oneOf: kinds, ...rest }, root),
      nullable: true,
    };
  return anyOf ? { oneOf: anyOf, ...rest } : schema;
}

const isAuto = (title, name) => title.toLowerCase().replaceAll(" ", "_") === name.toLowerCase();

/** What a field is called: the schema's own title, or the name of the property. */
const label = (name, schema = {}) =>
  schema.title && schema.type !== "object" && !isAuto(schema.title, name) ? schema.title : name.replaceAll("_", " ");

/** The range of a number in signs; bounds that only keep numbers within what can be computed are not worth any. */
function range(schema) {
  const { minimum, exclusiveMinimum, maximum, exclusiveMaximum } = schema,
    whole = schema.type === "integer";
  const low = minimum ?? exclusiveMinimum,
    high = maximum ?? (whole ? exclusiveMaximum - 1 : exclusiveMaximum);
  const open = exclusiveMinimum !== undefined || (low > 0 && low < 1e-6),
    from = low !== undefined && low > -1e6,
    to = high < 1e6;
  const start = low < 1e-6 && open ? 0 : low;
  if (from && to && !open && (whole || exclusiveMaximum === undefined)) return `${start} … ${high}`;
  return [
    from && `${open ? ">" : "≥"} ${start}`,
    to && `${exclusiveMaximum === undefined || whole ? "≤" : "<"} ${high}`,
  ]
    .filter(Boolean)
    .join(", ");
}

/** The number that was typed. Throws Error with what is wanted instead. */
function number(entered, schema) {
  const found = typed(entered);
  if (!Number.isFinite(found)) throw new Error(unreadable(entered));
  if (schema.type === "integer" && !Number.isInteger(found))
    throw new Error(`a whole number is wanted, found ${entered}`);
  const { minimum = -Infinity, maximum = Infinity, exclusiveMinimum = -Infinity, exclusiveMaximum = Infinity } = schema;
  const told = range(schema) || `${minimum} to ${maximum}`;
  if (found < minimum || found <= exclusiveMinimum) throw new Error(`${told} is wanted, found ${entered}`);
  if (found > maximum || found >= exclusiveMaximum)
    throw new Error(`${/^[>≥][^,]*$/.test(told) ? `≤ ${maximum}` : told} is wanted, found ${entered}`);
  return found;
}

/** What the schema says of a field, for a reader who sees fields and not JSON. */
const help = ({ description }) => description.replaceAll("`", "").replaceAll(/\bnull\b/g, "blank");

const isNumber = (schema) => schema.type === "number" || schema.type === "integer";
const shown = (value) => (value === undefined || value === null ? "" : String(value));

/** The parts of one form: what each field is called and how it says that it is wrong. */
class Fields {
  constructor(root) {
    Object.assign(this, { root, known: new Map(), units: [], lists: new Map() });
  }

  /** A labelled control, its unit, help and range, and a place for what is wrong with it. */
  field(at, name, schema, control, wide = false) {
    const id = `field-${++serial}`,
      wrong = build("span", { className: "error", id: `${id}-wrong` }),
      block = build("div", { className: wide ? "field wide" : "field" });
    const title = build("label", { htmlFor: id, textContent: label(name, schema) }),
      about = [],
      told = range(schema);
    control.id = id;
    if (schema.unit) title.append(" ", this.unit(schema.unit));
    block.append(title);
    if (told && isNumber(schema))
      about.push(build("span", { className: "range", id: `${id}-range`, textContent: told }));
    block.append(...about, control);
    if (schema.description)
      about.push(build("span", { className: "help", id: `${id}-help`, textContent: help(schema) }));
    block.append(...about.slice(-1).filter((one) => one.className === "help"), wrong);
    control.setAttribute("aria-describedby", [...about, wrong].map((one) => one.id).join(" "));
    this.known.set(at, { control, wrong, title: label(name, schema) });
    return block;
  }

  /** The unit beside a name; "angle" and "angle/s" follow the form's unit of angle. */
  unit(name) {
    const mark = build("span", { className: "unit" });
    this.units.push([mark, name]);
    return mark;
  }

  showUnits(angle) {
    for (const [mark, name] of this.units) mark.textContent = name.replace("angle", angle === "rad" ? "rad" : "°");
  }

  /** What `parse` makes of a control's text; undefined where it is empty. */
  read(at, control, parse) {
    const entered = control.value.trim();
    if (entered === "") return undefined;
    try {
      return parse(entered);
    } catch (error) {
      this.mark(at, error.message);
      throw new Error(`${this.known.get(at).title}: ${error.message}.`, { cause: error });
    }
  }

  mark(at, sentence) {
    const { control, wrong } = this.known.get(at);
    control.setAttribute("aria-invalid", "true");
    control.classList.add("invalid");
    wrong.textContent = sentence;
    for (let fold = control.closest("details"); fold; fold = fold.parentElement.closest("details")) fold.open = true;
    control.focus();
  }

  /** Where a field of a request stands in the form: its rows keep their place while others come and go. */
  place(pointer) {
    let at = pointer;
    for (const [list, entries] of this.lists) {
      const [index, ...rest] = at.startsWith(`${list}/`) ? at.slice(list.length + 1).split("/") : [];
      if (entries[index]) at = [list, entries[index].at, ...rest].join("/");
    }
    return at;
  }

  clear() {
    for (const { control, wrong } of this.known.values()) {
      control.removeAttribute("aria-invalid");
      control.classList.remove("invalid");
      wrong.textContent = "";
    }
  }

  /** Adds the controls of one property to `host`; returns a function that reads them, undefined for left out. */
  build(host, at, name, given, value, required = true) {
    const schema = plain(given, this.root);
    if (schema.oneOf) return this.variants(host, at, name, schema, value);
    if (schema.type === "object")
      return schema.nullable
        ? this.optional(host, at, name, schema, value)
        : this.group(host, at, name, schema, value, !required);
    if (schema.enum || schema.const !== undefined || schema.type === "boolean")
      return this.choice(host, at, name, schema, value);
    if (schema.type === "array") return this.list(host, at, name, schema, value);
    return this.entry(host, at, name, schema, value, (entered) =>
      isNumber(schema) ? number(entered, schema) : entered,
    );
  }

  entry(host, at, name, schema, value, parse, wide = false) {
    // where blank stands for the default, null has to be written: none
    const lifts = schema.nullable && schema.default !== undefined && schema.default !== null;
    const control = build("input", {
      type: "text",
      spellcheck: false,
      value: lifts && value === null ? "none" : shown(value),
    });
    if (isNumber(schema) && !lifts) control.inputMode = "decimal";
    control.placeholder = shown(Array.isArray(schema.default) ? schema.default.join(", ") : schema.default);
    host.append(
      this.field(
        at,
        name,
        lifts ? { ...schema, description: `${schema.description ?? ""} “none” takes it away.`.trim() } : schema,
        control,
        wide,
      ),
    );
    return () =>
      this.read(at, control, (entered) => (lifts && entered.toLowerCase() === "none" ? null : parse(entered)));
  }

  choice(host, at, name, schema, value) {
    const options = schema.enum ?? (schema.const === undefined ? [true, false] : [schema.const]),
      word = (option) => (option === true ? "yes" : option === false ? "no" : String(option).replaceAll("_", " "));
    const control = build("select");
    if (schema.const === undefined)
      control.append(
        new Option(
          schema.default === undefined || schema.default === null ? "–" : `${word(schema.default)} (default)`,
          "",
        ),
      );
    for (const option of options) control.append(new Option(word(option), JSON.stringify(option)));
    control.value =
      schema.const !== undefined
        ? JSON.stringify(schema.const)
        : value === undefined || value === null
          ? ""
          : JSON.stringify(value);
    if (name === "angle_unit")
      control.addEventListener("change", () =>
        this.showUnits(control.value ? JSON.parse(control.value) : schema.default),
      );
    host.append(this.field(at, name, schema, control));
    return () => (control.value === "" ? undefined : JSON.parse(control.value));
  }

  /** A box with a name, a sentence and room for fields; `folded` shows only the name until it is asked for more. */
  box(host, title, schema, folded = false) {
    const grid = build("div", { className: "fields" }),
      box = build("fieldset"),
      said = schema.description ? [build("p", { className: "help", textContent: help(schema) })] : [];
    if (folded)
      box.append(
        build("legend", { className: "hidden", textContent: title }),
        build("details", {}, build("summary", { textContent: title }), ...said, grid),
      );
    else box.append(build("legend", {}, title), ...said, grid);
    host.append(box);
    return grid;
  }

  /** The properties of an object below its name. */
  group(host, at, name, schema, value, folded) {
    return this.properties(
      this.box(host, label(name, schema), schema, folded && value === undefined),
      at,
      schema,
      value,
    );
  }

  properties(grid, at, schema, value, left = []) {
    const readers = Object.entries(schema.properties ?? {})
      .filter(([part]) => !left.includes(part))
      .map(([part, kind]) => [
        part,
        this.build(grid, `${at}/${part}`, part, kind, value?.[part], schema.required?.includes(part)),
      ]);
    return () => {
      const entries = readers.map(([part, read]) => [part, read()]).filter(([, found]) => found !== undefined);
      return entries.length ? Object.fromEntries(entries) : undefined;
    };
  }

  /** An object that may be left out: a switch, and its properties while that is on. */
  optional(host, at, name, schema, value) {
    const toggle = build("input", { type: "checkbox" }),
      stands = value === undefined ? schema.default : value;
    const grid = this.box(host, build("label", { className: "check" }, toggle, label(name, schema)), schema);
    toggle.checked = stands !== undefined && stands !== null;
    const read = this.properties(grid, at, schema, stands ?? undefined),
      show = () => {
        grid.hidden = !toggle.checked;
      };
    toggle.addEventListener("change", show);
    show();
    return () =>
      toggle.checked ? (read() ?? {}) : schema.default === undefined || schema.default === null ? undefined : null;
  }

  /** One of several kinds of value: which one, and the fields of that kind. */
  variants(host, at, name, schema, value) {
    const tag = schema.discriminator?.propertyName,
      kinds = schema.oneOf.map((kind) => plain(kind, this.root));
    const word = (kind) =>
      String(kind.properties?.[tag]?.const ?? kind.title ?? (kind.type === "array" ? "list" : kind.type)).replaceAll(
        "_",
        " ",
      );
    const stands = value ?? schema.default;
    const fits = (kind) =>
      tag
        ? kind.properties[tag].const === stands?.[tag]
        : kind.type === (Array.isArray(stands) ? "array" : typeof stands);
    const chosen = build("select"),
      box = build("fieldset"),
      grid = build("div", { className: "fields" });
    if (schema.nullable) chosen.append(new Option("–", ""));
    for (const [k, kind] of kinds.entries()) chosen.append(new Option(word(kind), k));
    chosen.value =
      stands === undefined || stands === null
        ? schema.nullable
          ? ""
          : "0"
        : String(Math.max(0, kinds.findIndex(fits)));
    box.append(
      build("legend", { className: "hidden", textContent: label(name, schema) }),
      this.field(at, name, { ...schema, type: "kind" }, chosen),
      grid,
    );
    host.append(box);
    let read = () => undefined;
    const show = (now) => {
      for (const known of this.known.keys()) if (known.startsWith(`${at}/`)) this.known.delete(known);
      grid.replaceChildren();
      const kind = kinds[Number(chosen.value)];
      if (chosen.value === "") read = () => undefined;
      else if (tag) {
        const rest = this.properties(grid, at, kind, now, [tag]);
        read = () => ({ [tag]: kind.properties[tag].const, ...rest() });
      } else read = this.build(grid, `${at}/`, name, kind, now);
    };
    chosen.addEventListener("change", () => {
      show(undefined);
      this.showUnits(this.angle?.());
    });
    show(stands);
    return () => read();
  }

  list(host, at, name, schema, value) {
    const items = plain(schema.items ?? {}, this.root),
      count = schema.maxItems === schema.minItems ? schema.maxItems : 0;
    if (items.enum) return this.checks(host, at, name, schema, items, value);
    if (items.properties || items.oneOf) return this.rows(host, at, name, schema, items, value);
    if (items.type === "array") return this.matrix(host, at, name, schema, items, value);
    if (count && count <= 4) return this.tuple(host, at, name, schema, items, count, value);
    const described = {
      ...schema,
      description: [schema.description, "Numbers, with spaces, semicolons or commas between."]
        .filter(Boolean)
        .join(" "),
    };
    return this.entry(
      host,
      at,
      name,
      described,
      value?.join(", "),
      (entered) => readCells([entered])[0].map((part) => number(part, items)),
      true,
    );
  }

  /** A few numbers that belong together, a field for each; `parts` of the schema names them. */
  tuple(host, at, name, schema, items, count, value) {
    const unit = schema.unit ? ` (${schema.unit.replace("angle", "angle unit")})` : "";
    const grid = this.box(
      host,
      `${label(name, schema)}${unit}`,
      schema,
      schema.nullable && (value === undefined || value === null),
    );
    grid.classList.add("tuple");
    const names = schema.parts ?? ["x", "y", "z", "w"].slice(0, count),
      partly = items.nullable;
    const readers = names.map((part, k) =>
      this.build(grid, `${at}/${k}`, part, { ...items, unit: undefined, default: schema.default?.[k] }, value?.[k]),
    );
    return () => {
      const found = readers.map((read) => read());
      if (found.every((part) => part === undefined)) return undefined;
      if (partly) return found.map((part, k) => (part === undefined ? (schema.default?.[k] ?? null) : part));
      const missing = found.indexOf(undefined);
      if (missing >= 0) this.mark(`${at}/${missing}`, "wanted with the others");
      if (missing >= 0) throw new Error(`${label(name, schema)}: ${names[missing]} is missing.`);
      return found;
    };
  }

  /** Rows of numbers, a line for each. */
  matrix(host, at, name, schema, items, value) {
    const control = build("textarea", {
      spellcheck: false,
      value: (value ?? []).map((row) => row.join(", ")).join("\n"),
    });
    const described = {
      ...schema,
      description: [schema.description, `A row on each line, ${items.maxItems ?? "some"} numbers in it.`]
        .filter(Boolean)
        .join(" "),
    };
    host.append(this.field(at, name, described, control, true));
    const row = (cells, k) => {
      const found = cells.map((part) => number(part, items.items ?? {}));
      if (items.maxItems && (found.length < items.minItems || found.length > items.maxItems))
        throw new Error(`line ${k + 1} has ${found.length} numbers instead of ${items.maxItems}`);
      return found;
    };
    return () =>
      this.read(at, control, (entered) => readCells(entered.split("\n").filter((line) => line.trim())).map(row));
  }

  checks(host, at, name, schema, items, value) {
    const grid = this.box(host, label(name, schema), schema);
    grid.className = "checks";
    const controls = items.enum.map((option) => {
      const control = build("input", { type: "checkbox", checked: (value ?? schema.default ?? []).includes(option) });
      grid.append(build("label", { className: "check" }, control, String(option).replaceAll("_", " ")));
      return [option, control];
    });
    return () => controls.filter(([, control]) => control.checked).map(([option]) => option);
  }

  /** A list of groups with buttons that add and remove them. */
  rows(host, at, name, schema, items, value) {
    const box = build("fieldset"),
      rows = build("div", { className: "rows" }),
      add = build("button", { type: "button", textContent: "Add one" });
    const title = label(name, schema),
      entries = [];
    this.lists.set(at, entries);
    box.append(build("legend", { textContent: title }), rows, add);
    host.append(box);
    const append = (one) => {
      const row = build("div", { className: "row" }),
        entry = { row, read: null, at: ++serial },
        gone = build("button", { type: "button", className: "link", textContent: "Remove" });
      entry.read = this.build(
        row,
        `${at}/${entry.at}`,
        `${title} ${entries.length + 1}`,
        { ...items, title: undefined, description: undefined },
        one,
      );
      gone.setAttribute("aria-label", `Remove ${title} ${entries.length + 1}`);
      gone.addEventListener("click", () => {
        entries.splice(entries.indexOf(entry), 1);
        row.remove();
        add.focus();
      });
      row.append(gone);
      entries.push(entry);
      rows.append(row);
      this.showUnits(this.angle?.());
    };
    for (const one of value ?? []) append(one);
    add.addEventListener("click", () => append(entries.at(-1)?.read() ?? {}));
    return () => (entries.length ? entries.map((entry) => entry.read() ?? {}) : undefined);
  }
}

/**
 * The form of a request in `host`, filled with `example`: {read, mark}. `read()` returns the request, without what was
 * left blank; it marks a wrong field and throws Error. `mark(rows)` marks what the service found wrong, {pointer, detail}.
 */
export function buildForm(host, schema, example) {
  const fields = new Fields(schema),
    near = build("div", { className: "fields" }),
    far = build("div", { className: "fields" });
  const readers = Object.entries(schema.properties ?? {}).map(([name, kind]) => {
    // optional parameters that the example does not set go into the folded part
    const folded = example[name] === undefined && !(schema.required ?? []).includes(name);
    return [name, fields.build(folded ? far : near, `/${name}`, name, kind, example[name], !folded)];
  });
  const angle = readers.find(([name]) => name === "angle_unit")?.[1];
  fields.angle = () => angle?.();
  fields.showUnits(fields.angle());
  host.replaceChildren(near);
  if (far.childElementCount)
    host.append(
      build("details", { open: !near.childElementCount }, build("summary", { textContent: "More parameters" }), far),
    );
  return {
    read() {
      fields.clear();
      const known = Object.fromEntries(
        readers.map(([name, read]) => [name, read()]).filter(([, found]) => found !== undefined),
      );
      // null differs from leaving out: a null of the example is sent as long as its field is blank
      for (const [name, value] of Object.entries(example)) if (value === null && !(name in known)) known[name] = null;
      return known;
    },
    mark(rows) {
      for (const { pointer, detail } of rows.toReversed()) {
        const at = fields.place((pointer ?? "").replace(/^#/, "")),
          found = [...fields.known.keys()]
            .filter((one) => at === one || at.startsWith(`${one}/`))
            .sort((a, b) => b.length - a.length)[0];
        if (found) fields.mark(found, detail);
      }
    },
  };
}
