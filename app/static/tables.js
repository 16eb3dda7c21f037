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

/** The other question of a table: its name, the columns that only it reads, and the words for it. */
const OTHER = {
  synthesize: ["function", "input output", "These are columns of a function: choose Function for them"],
  function: [
    "synthesize",
    "angle crank",
    "These are columns of a motion: for poses, choose Motion and paste the table",
  ],
};

/** Points to the other question if the named columns of the table are read there; else "". */
async function pointer(table, kind) {
  const [query, roles, sentence] = OTHER[kind],
    { status, columns } = await (await ask("/v2/motion", { ...table, query })).json(),
    isOther = ({ role, head }) => roles.split(" ").includes(role) && !/^\d+$/.test(head);
  return status === "read" && columns.some(isOther) ? sentence : "";
}

/**
 * Reads a table, text or a file, for a question of the service: {request, length_unit, columns, headings, notes}.
 * `columns` chooses columns. Throws Error with a sentence, which is `ofOther` for a table of the other question; if
 * columns have to be chosen it has the `headings` of the table.
 */
export async function readTable(source, question, columns = null) {
  const table = typeof source === "string" ? { table: source } : { file: await base64Of(source) },
    reply = await (await ask("/v2/motion", { ...table, query: question, ...(columns && { columns }) })).json();
  if (reply.status === "read") {
    const { columns: used, headings } = reply,
      hint = !columns && used.length < headings.length ? await pointer(table, question) : "";
    return { ...reply, notes: [...reply.notes, hint].filter(Boolean) };
  }
  const hint = columns ? "" : await pointer(table, question);
  if (hint) throw Object.assign(new Error(`${hint}.`), { ofOther: true });
  const { message, headings } = reply,
    below = question === "synthesize" ? "; or choose the columns below" : "",
    detail = message.replace(/; or choose columns, as in .*$/, below);
  throw Object.assign(new Error(`${capital(detail)}.`), { headings: headings.length ? headings : null });
}
