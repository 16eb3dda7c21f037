// The table of a function as the service has read it: pairs of x and y, or of input and output.

import { capital } from "./shell.js";
import { readTable } from "./tables.js";

const READING = "The table is being read.";

export class Pairs {
  /** `changed()` is called when a table has been read. */
  constructor(changed) {
    Object.assign(this, { changed, table: { content: null } });
  }

  /** Has the service read a text, unless it is read or being read; resolves when it is done. */
  read(content) {
    if (this.table.content !== content) {
      this.table = { content, error: new Error(READING) };
      this.table.done = this.#fill(this.table);
    }
    return this.table.done;
  }

  async #fill(table) {
    document.body.dataset.reading = "true";
    try {
      const { request, columns, notes } = await readTable(table.content, "function"),
        units = Object.fromEntries(columns.map(({ role, unit }) => [role, unit])),
        bare = columns.every(({ head }) => /^\d+$/.test(head));
      Object.assign(table, { request, notes, units, bare, error: null });
    } catch (error) {
      table.error = error;
    }
    if (table !== this.table) return;
    delete document.body.dataset.reading;
    this.changed();
  }

  /** Notes on the interpretation of the table, as sentences; "" if it was not read. */
  get notes() {
    return (this.table.notes ?? []).map((note) => capital(note.replace(/\.?$/, "."))).join(" ");
  }

  /** Check the units of the table against the ends of a linkage: `ends` names the lengths. Throws Error. */
  check(ends) {
    for (const end of ["input", "output"]) {
      const unit = this.table.units?.[end],
        turns = ["deg", "rad"].includes(unit),
        correction = `here it is ${turns ? "a length" : "an angle"}: choose another linkage, or change the heading.`;
      if (unit && turns === (ends[`${end}_unit`] === "length"))
        throw new Error(`The table has the ${end} in ${unit}, and ${correction}`);
    }
  }

  /** {x, y} or {output, input} of a text that was read; `numbers` without heads are x and y. Throws Error. */
  of(content, numbers) {
    const { table } = this;
    if (table.content !== content) throw new Error(READING);
    if (table.error) throw table.error;
    const { input, output, function: functionFields } = table.request;
    if (functionFields) return { x: functionFields.table.map(([x]) => x), y: functionFields.table.map(([, y]) => y) };
    if (!numbers || !table.bare) return { input, output };
    if (!input) throw new Error("Each row must hold x, y.");
    return { x: input, y: output };
  }
}
