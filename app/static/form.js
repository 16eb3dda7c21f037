// Builds a form of labelled fields from the JSON schema of a request, reads the request back, and marks wrong fields.

import { listEntries, typed, unreadable } from "./decimal.js";
import { element } from "./drawing.js";
import { build, listed, spaced } from "./shell.js";

let serial = 0;

/** A schema with its references resolved; `nullable` where null was one of its alternatives. */
function plain({ $ref, allOf, anyOf, ...keywords }, root) {
  if ($ref) return plain({ ...root.$defs[$ref.split("/").at(-1)], ...keywords }, root);
  if (allOf?.length === 1) return plain({ ...allOf[0], ...keywords }, root);
  if (!anyOf) return keywords;
  const [kind] = anyOf.filter(({ type }) => type !== "null");
  return { ...plain({ ...kind, ...keywords }, root), nullable: true };
}

const isAuto = (title, name) => title.toLowerCase().replaceAll(" ", "_") === name.toLowerCase();

/** Return the label of a field: the schema's title, or the name of the property. */
const label = (name, { title, type } = {}) =>
  title && type !== "object" && !isAuto(title, name) ? title : spaced(name);

/** The range of a number in signs; bounds that only keep numbers within what can be computed are not worth any. */
function range({ type, minimum, exclusiveMinimum, maximum, exclusiveMaximum }) {
  const isInteger = type === "integer",
    low = minimum ?? exclusiveMinimum,
    high = maximum ?? (isInteger ? exclusiveMaximum - 1 : exclusiveMaximum),
    open = exclusiveMinimum !== undefined || (low > 0 && low < 1e-6),
    closed = isInteger || exclusiveMaximum === undefined,
    [from, to] = [low !== undefined && low > -1e6, high < 1e6],
    start = low < 1e-6 && open ? 0 : low;
  if (from && to && !open && closed) return `${start} … ${high}`;
  return listed(from && `${open ? ">" : "≥"} ${start}`, to && `${closed ? "≤" : "<"} ${high}`);
}

/** The number that was typed. Throws Error with what is wanted instead. */
function number(entered, schema) {
  const found = typed(entered);
  if (!Number.isFinite(found)) throw new Error(unreadable(entered));
  if (schema.type === "integer" && !Number.isInteger(found))
    throw new Error(`must be a whole number; it is ${entered}`);
  const { minimum = -Infinity, maximum = Infinity, exclusiveMinimum = -Infinity, exclusiveMaximum = Infinity } = schema,
    allowed = range(schema) || `${minimum} to ${maximum}`,
    above = /^[>≥][^,]*$/.test(allowed) ? `≤ ${maximum}` : allowed;
  if (found < minimum || found <= exclusiveMinimum) throw new Error(`must be ${allowed}; it is ${entered}`);
  if (found > maximum || found >= exclusiveMaximum) throw new Error(`must be ${above}; it is ${entered}`);
  return found;
}

/** Return the schema's description of a field, for a reader who sees fields and not JSON. */
const help = ({ description }) => description.replaceAll("`", "").replaceAll(/\bnull\b/g, "blank");

const isNumber = ({ type }) => type === "number" || type === "integer";
const isNone = (value) => value === undefined || value === null;
const shown = (value) => (isNone(value) ? "" : String(value));
const described = (schema, more) => ({ ...schema, description: [schema.description, more].filter(Boolean).join(" ") });

/** The parts of one form: what each field is called and how it says that it is wrong. */
class Fields {
  known = new Map();
  units = [];

  constructor(root) {
    this.root = root;
  }

  /** A labelled control, its unit, help and range, and a place for what is wrong with it. */
  field(at, name, schema, control, wide = false) {
    const id = `field-${++serial}`,
      part = (kind, content) => build("span", { className: kind, id: `${id}-${kind}` }, content),
      title = build("label", { htmlFor: id }, label(name, schema), schema.unit && [" ", this.unit(schema.unit)].flat()),
      rangeNode = isNumber(schema) && range(schema) && part("range", range(schema)),
      about = schema.description && part("help", help(schema)),
      wrong = part("error", "");
    control.id = id;
    const parts = [rangeNode, about, wrong].filter(Boolean);
    control.setAttribute("aria-describedby", parts.map((node) => node.id).join(" "));
    this.known.set(at, { control, wrong, title: label(name, schema) });
    return element("div", wide ? "field wide" : "field", title, rangeNode, control, about, wrong);
  }

  /** The unit beside a name; "angle" and "angle/s" follow the form's unit of angle. */
  unit(name) {
    const mark = element("span", "unit");
    this.units.push([mark, name]);
    return mark;
  }

  showUnits(angle = this.angle?.()) {
    for (const [mark, name] of this.units) mark.textContent = name.replace("angle", angle === "rad" ? "rad" : "°");
  }

  /** Return the text of a control as converted by `parse`; undefined if it is empty. */
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

  clear() {
    for (const { control, wrong } of this.known.values()) {
      control.removeAttribute("aria-invalid");
      control.classList.remove("invalid");
      wrong.textContent = "";
    }
  }

  /** Adds the controls of one property to `host`; returns a function that reads them, undefined for left out. */
  build(host, at, name, unresolved, value, required = true) {
    const schema = plain(unresolved, this.root),
      { type } = schema,
      context = [host, at, name, schema, value];
    if (schema.oneOf) return this.variants(...context);
    if (type === "object") return schema.nullable ? this.optional(...context) : this.group(...context, !required);
    if (schema.enum || schema.const !== undefined || type === "boolean") return this.choice(...context);
    if (type === "array") return this.list(...context);
    return this.entry(...context, (entered) => (isNumber(schema) ? number(entered, schema) : entered));
  }

  entry(host, at, name, schema, value, parse, wide = false) {
    // where blank stands for the default, null has to be written: none
    const lifts = schema.nullable && !isNone(schema.default),
      helpSchema = lifts ? described(schema, "“none” removes it.") : schema;
    const control = build("input", {
      type: "text",
      spellcheck: false,
      value: lifts && value === null ? "none" : shown(value),
      placeholder: shown(Array.isArray(schema.default) ? schema.default.join(", ") : schema.default),
      inputMode: isNumber(schema) && !lifts ? "decimal" : "",
    });
    host.append(this.field(at, name, helpSchema, control, wide));
    const read = (entered) => (lifts && entered.toLowerCase() === "none" ? null : parse(entered));
    return () => this.read(at, control, read);
  }

  choice(host, at, name, schema, value) {
    const fixed = schema.const !== undefined,
      options = schema.enum ?? (fixed ? [schema.const] : [true, false]),
      word = (option) => (typeof option === "boolean" ? (option ? "yes" : "no") : spaced(option)),
      blank = isNone(schema.default) ? "–" : `${word(schema.default)} (default)`,
      chosen = fixed ? schema.const : value;
    const control = build("select", {}, fixed ? [] : new Option(blank, ""));
    control.append(...options.map((option) => new Option(word(option), JSON.stringify(option))));
    control.value = isNone(chosen) ? "" : JSON.stringify(chosen);
    const read = () => (control.value === "" ? undefined : JSON.parse(control.value));
    if (name === "angle_unit") control.addEventListener("change", () => this.showUnits(read() ?? schema.default));
    host.append(this.field(at, name, schema, control));
    return read;
  }

  /** A box with a name, a sentence and room for fields; `folded` shows only the name until it is asked for more. */
  box(host, title, schema, folded = false) {
    const grid = element("div", "fields"),
      description = schema.description && element("p", "help", help(schema)),
      fold = folded && build("details", {}, build("summary", {}, title), description, grid);
    host.append(
      build("fieldset", {}, element("legend", folded ? "hidden" : "", title), ...(fold ? [fold] : [description, grid])),
    );
    return grid;
  }

  /** The properties of an object below its name. */
  group(host, at, name, schema, value, folded) {
    const grid = this.box(host, label(name, schema), schema, folded && value === undefined);
    return this.properties(grid, at, schema, value);
  }

  properties(grid, at, schema, value, left = []) {
    const parts = Object.entries(schema.properties ?? {}).filter(([part]) => !left.includes(part)),
      isRequired = (part) => schema.required?.includes(part);
    const readers = parts.map(([part, kind]) => {
      const read = this.build(grid, `${at}/${part}`, part, kind, value?.[part], isRequired(part));
      return [part, read];
    });
    return () => {
      const entries = readers.map(([part, read]) => [part, read()]).filter(([, found]) => found !== undefined);
      return entries.length ? Object.fromEntries(entries) : undefined;
    };
  }

  /** An object that may be left out: a switch, and its properties while that is on. */
  optional(host, at, name, schema, value) {
    const initial = value === undefined ? schema.default : value,
      toggle = build("input", { type: "checkbox", checked: !isNone(initial) }),
      grid = this.box(host, build("label", { className: "check" }, toggle, label(name, schema)), schema),
      read = this.properties(grid, at, schema, initial ?? undefined);
    const show = () => (grid.hidden = !toggle.checked);
    toggle.addEventListener("change", show);
    show();
    const none = isNone(schema.default) ? undefined : null;
    return () => (toggle.checked ? (read() ?? {}) : none);
  }

  /** One of several kinds of object: which one, and the other fields of that kind. */
  variants(host, at, name, schema, value) {
    const tag = schema.discriminator.propertyName,
      kinds = schema.oneOf.map((kind) => plain(kind, this.root)),
      nameOf = (kind) => kind.properties[tag].const,
      initial = value ?? schema.default,
      options = kinds.map((kind, k) => new Option(spaced(nameOf(kind)), k)),
      chosen = build("select", {}, options),
      grid = element("div", "fields"),
      title = element("legend", "hidden", label(name, schema));
    chosen.value = Math.max(
      0,
      kinds.findIndex((kind) => nameOf(kind) === initial?.[tag]),
    );
    host.append(build("fieldset", {}, title, this.field(at, name, { ...schema, type: "kind" }, chosen), grid));
    let read = null;
    const show = (now) => {
      const kind = kinds[Number(chosen.value)];
      for (const pointer of this.known.keys()) if (pointer.startsWith(`${at}/`)) this.known.delete(pointer);
      grid.replaceChildren();
      const readRemaining = this.properties(grid, at, kind, now, [tag]);
      read = () => ({ [tag]: nameOf(kind), ...readRemaining() });
    };
    chosen.addEventListener("change", () => {
      show(undefined);
      this.showUnits();
    });
    show(initial);
    return () => read();
  }

  list(host, at, name, schema, value) {
    const items = plain(schema.items ?? {}, this.root),
      count = schema.maxItems === schema.minItems ? schema.maxItems : 0,
      context = [host, at, name, schema, items, value];
    if (items.enum) return this.checks(...context);
    if (items.type === "array") return this.matrix(...context);
    if (count && count <= 4) return this.tuple(...context, count);
    const helpSchema = described(schema, "Numbers, with spaces, semicolons or commas between."),
      parse = (entered) => listEntries(entered).map((part) => number(part, items));
    return this.entry(host, at, name, helpSchema, value?.join(", "), parse, true);
  }

  /** A few numbers that belong together, a field for each; `parts` of the schema names them. */
  tuple(host, at, name, schema, items, value, count) {
    const unit = schema.unit ? ` (${schema.unit.replace("angle", "angle unit")})` : "",
      title = label(name, schema),
      grid = this.box(host, title + unit, schema, schema.nullable && isNone(value)),
      names = schema.parts ?? ["x", "y", "z", "w"].slice(0, count),
      defaults = schema.default ?? [];
    grid.classList.add("tuple");
    const readers = names.map((part, k) => {
      const item = { ...items, unit: undefined, default: defaults[k] };
      return this.build(grid, `${at}/${k}`, part, item, value?.[k]);
    });
    return () => {
      const found = readers.map((read) => read()),
        missing = found.indexOf(undefined);
      if (found.every((part) => part === undefined)) return undefined;
      if (items.nullable) return found.map((part, k) => (part === undefined ? (defaults[k] ?? null) : part));
      if (missing < 0) return found;
      this.mark(`${at}/${missing}`, "is required if the other numbers are given");
      throw new Error(`${title}: ${names[missing]} is missing.`);
    };
  }

  /** Rows of numbers, a line for each. */
  matrix(host, at, name, schema, items, value) {
    const shownRows = (value ?? []).map((row) => row.join(", ")).join("\n"),
      control = build("textarea", { spellcheck: false, value: shownRows }),
      { minItems, maxItems } = items,
      helpSchema = described(schema, `A row on each line, ${maxItems ?? "some"} numbers in it.`);
    host.append(this.field(at, name, helpSchema, control, true));
    const row = (line, k) => {
      const found = listEntries(line).map((part) => number(part, items.items ?? {})),
        count = found.length;
      if (maxItems && (count < minItems || count > maxItems))
        throw new Error(`line ${k + 1} has ${count} numbers instead of ${maxItems}`);
      return found;
    };
    const lines = (entered) => entered.split("\n").filter((line) => line.trim());
    return () => this.read(at, control, (entered) => lines(entered).map(row));
  }

  checks(host, at, name, schema, items, value) {
    const grid = this.box(host, label(name, schema), schema),
      chosen = value ?? schema.default ?? [];
    grid.className = "checks";
    const controls = items.enum.map((option) => {
      const control = build("input", { type: "checkbox", checked: chosen.includes(option) });
      grid.append(build("label", { className: "check" }, control, spaced(option)));
      return [option, control];
    });
    return () => controls.filter(([, control]) => control.checked).map(([option]) => option);
  }
}

/**
 * The form of a request in `host`, filled with `example`: {read, mark}. `read()` returns the request, without what was
 * left blank; it marks a wrong field and throws Error. `mark(rows)` marks fields that the service refuses, {pointer,
 * detail}.
 */
export function buildForm(host, schema, example) {
  const fields = new Fields(schema),
    near = element("div", "fields"),
    far = element("div", "fields");
  const readers = Object.entries(schema.properties ?? {}).map(([name, kind]) => {
    // optional parameters that the example does not set go into the folded part
    const folded = example[name] === undefined && !(schema.required ?? []).includes(name);
    return [name, fields.build(folded ? far : near, `/${name}`, name, kind, example[name], !folded)];
  });
  fields.angle = readers.find(([name]) => name === "angle_unit")?.[1];
  fields.showUnits();
  host.replaceChildren(near);
  const open = !near.childElementCount;
  if (far.childElementCount) host.append(build("details", { open }, build("summary", {}, "More parameters"), far));
  return {
    read() {
      fields.clear();
      const entries = readers.map(([name, read]) => [name, read()]).filter(([, found]) => found !== undefined),
        body = Object.fromEntries(entries);
      // null differs from leaving out: a null of the example is sent as long as its field is blank
      for (const [name, value] of Object.entries(example)) if (value === null && !(name in body)) body[name] = null;
      return body;
    },
    mark(rows) {
      for (const { pointer, detail } of rows.toReversed()) {
        const at = (pointer ?? "").replace(/^#/, ""),
          holding = [...fields.known.keys()].filter(
            (fieldPointer) => at === fieldPointer || at.startsWith(`${fieldPointer}/`),
          ),
          [found] = holding.sort((a, b) => b.length - a.length);
        if (found) fields.mark(found, detail);
      }
    },
  };
}
