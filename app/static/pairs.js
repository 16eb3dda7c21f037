// The table of a function as the service has read it: pairs of x and y, or of input and output.

import { readTable } from "./csv.js";

const READING = "The table is being read.";

export class Pairs {
  /** `changed()` is called when a table has been read. */
  constructor(changed) { Object.assign(this, { changed, table: { content: null } }); }

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
      const { request, columns } = await readTable(table.content, "function");
      Object.assign(table, { request, error: null, bare: columns.every(({ head }) => /^\d+$/.test(head)) });
    } catch (error) { table.error = error; }
    if (table !== this.table) return;
    delete document.body.dataset.reading;
    this.changed();
  }

  /** {x, y} or {output, input} of a text that was read; `numbers`: two columns without heads are x and y. Throws Error for any other text. */
  of(content, numbers) {
    const { table } = this;
    if (table.content !== content) throw new Error(READING);
    if (table.error) throw table.error;
    const { input, output, function: given } = table.request;
    if (given) return { x: given.table.map(([x]) => x), y: given.table.map(([, y]) => y) };
    if (!numbers || !table.bare) return { input, output };
    if (!input) throw new Error("Each row must hold x, y.");
    return { x: input, y: output };
  }
}
