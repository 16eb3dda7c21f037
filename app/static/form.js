// Builds a form from the JSON schema of a request and reads the request back; a blank field is left out of it.

const label = (name) => name.replaceAll("_", " ");

/** A schema with its references resolved and without the null alternative of optional values. */
function plain(schema, root) {
  if (schema.$ref) return plain({ ...root.$defs[schema.$ref.split("/").at(-1)], ...Object.fromEntries(Object.entries(schema).filter(([key]) => key !== "$ref")) }, root);
  const kinds = (schema.anyOf ?? []).filter((kind) => kind.type !== "null");
  if (schema.anyOf && kinds.length === 1) {
    const { anyOf, ...rest } = schema;
    return plain({ ...kinds[0], ...rest }, root);
  }
  if (schema.allOf?.length === 1) return plain({ ...schema.allOf[0], ...schema, allOf: undefined }, root);
  return schema;
}

const choices = (schema) => schema.enum ?? (schema.const === undefined ? null : [schema.const]);

let serial = 0;

function field(name, control, schema) {
  const block = document.createElement("label");
  block.className = "field";
  block.append(label(name), control);
  if (schema.description) {
    const help = document.createElement("span");
    help.className = "help";
    help.id = `help-${++serial}`;
    help.textContent = schema.description;
    control.setAttribute("aria-describedby", help.id);
    block.append(help);
  }
  return block;
}

const shown = (value) => (value === undefined || value === null ? "" : typeof value === "object" ? JSON.stringify(value) : String(value));

function reader(name, parse) {
  return (control) => {
    const entered = control.value.trim();
    control.classList.remove("invalid");
    if (entered === "") return undefined;
    try {
      return parse(entered);
    } catch {
      control.classList.add("invalid");
      control.focus();
      throw new Error(`${label(name)}: '${entered.slice(0, 40)}' cannot be read as a value.`);
    }
  };
}

/** Adds the control of one property to `host`; returns a function that reads it, undefined for left out. */
function build(host, name, given, value, root) {
  const schema = plain(given, root);
  const options = choices(schema);
  if (schema.type === "object" && schema.properties) {
    const group = document.createElement("fieldset");
    const legend = document.createElement("legend");
    legend.textContent = label(name);
    group.append(legend);
    host.append(group);
    const readers = Object.entries(schema.properties).map(([part, kind]) => [part, build(group, part, kind, value?.[part], root)]);
    return () => {
      const entries = readers.map(([part, read]) => [part, read()]).filter(([, found]) => found !== undefined);
      return entries.length ? Object.fromEntries(entries) : undefined;
    };
  }
  if (options || schema.type === "boolean") {
    const control = document.createElement("select");
    control.append(new Option(schema.default === undefined ? "–" : `default (${shown(schema.default)})`, ""));
    for (const option of options ?? [true, false]) control.append(new Option(String(option), JSON.stringify(option)));
    control.value = value === undefined || value === null ? "" : JSON.stringify(value);
    host.append(field(name, control, schema));
    return () => (control.value === "" ? undefined : JSON.parse(control.value));
  }
  const control = document.createElement("input");
  const number = schema.type === "number" || schema.type === "integer";
  control.type = "text";
  control.spellcheck = false;
  if (number) control.inputMode = "decimal";
  control.value = value === null && number ? "" : shown(value);
  if (schema.default !== undefined && schema.default !== null) control.placeholder = shown(schema.default);
  host.append(field(name, control, schema));
  const read = reader(name, (entered) => {
    if (!number) return JSON.parse(entered);
    const found = Number(entered);
    if (!Number.isFinite(found)) throw new Error();
    return found;
  });
  return () => read(control);
}

/** The form of a request in `host`, filled with an example; returns a function that reads the request. */
export function buildForm(host, schema, example) {
  host.replaceChildren();
  const entries = Object.entries(schema.properties ?? {});
  const far = [];
  const readers = entries.map(([name, kind]) => {
    const part = document.createElement("div");
    const read = build(part, name, kind, example[name], schema);
    // optional parameters that the example does not set go into the folded part
    if (example[name] === undefined && !(schema.required ?? []).includes(name)) far.push(part);
    else host.append(part);
    return [name, read];
  });
  if (far.length) {
    const fold = document.createElement("details");
    const summary = document.createElement("summary");
    summary.textContent = far.length === entries.length ? "Parameters" : "More parameters";
    fold.append(summary, ...far);
    fold.addEventListener("invalid", () => { fold.open = true; }, true);
    host.append(fold);
  }
  return () => {
    const values = readers.map(([name, read]) => [name, read()]).filter(([, found]) => found !== undefined);
    const known = Object.fromEntries(values);
    // null differs from leaving out: a null of the example is sent as long as its field is blank
    for (const [name, value] of Object.entries(example)) if (value === null && !(name in known)) known[name] = null;
    return known;
  };
}
