// Tables of samples, which the service reads.

import { ask } from "./service.js";
import { capital } from "./shell.js";

/** The bytes of a file in base64. */
function base64Of(file) {
  return new Promise((resolve, reject) => {
    const reader = new FileReader();
    reader.addEventListener("load", () => resolve(reader.result.slice(reader.result.indexOf(",") + 1)));
    reader.addEventListener("error", () => reject(new Error("The file cannot be read.")));
    reader.readAsDataURL(file);
  });
}

/**
 * Reads a table, text or a file, for a question of the service: {request, length_unit, columns, heads, notes}. `columns` chooses columns.
 * Throws Error with a sentence; if columns have to be chosen it has the `heads` of the table.
 */
export async function readTable(source, question, columns = null) {
  const table = typeof source === "string" ? { table: source } : { file: await base64Of(source) };
  const reply = await (await ask("/v1/motion", { ...table, question, ...(columns ? { columns } : {}) })).json();
  if (reply.status === "read") return reply;
  const { message, heads } = reply, detail = message.replace(/; or choose columns, as in .*$/, question === "synthesize" ? "; or choose the columns below" : "");
  throw Object.assign(new Error(`${capital(detail)}.`), { heads: heads.length ? heads : null });
}
