// HTTP calls to the service: one request, the staged search, error replies as sentences, downloads.

/** Budgets of the search in milliseconds, one after the other: a first answer soon, then better ones. */
export const STAGES = [120, 1000, 5000];

/** An error reply (problem+json) of the service; the message names at most three wrong fields. */
class Problem extends Error {
  constructor(status, body) {
    const rows = (body?.errors ?? []).map((row) => `${(row.pointer ?? "").replace(/^#\/?/, "").replaceAll("/", " ") || "request"}: ${row.detail}`);
    super(rows.length ? rows.slice(0, 3).join("; ") : body?.detail ?? `The service answered with ${status}.`);
    this.status = status;
    this.rows = body?.errors ?? [];
  }
}

/** POSTs `body` as JSON. Throws Error with a sentence for the user, or the signal's AbortError. */
export async function ask(path, body, signal) {
  let reply;
  try {
    reply = await fetch(path, { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body), signal });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Error("The service cannot be reached.", { cause: error });
  }
  if (reply.ok) return reply;
  throw new Problem(reply.status, await reply.json().catch(() => null));
}

/** Repeats the search with the next budget as long as the budget ended it; `show(reply, last)` gets each answer. */
export async function solve(request, show, signal) {
  for (const [k, budget] of STAGES.entries()) {
    const reply = await (await ask("/v1/synthesize", { ...request, budget_ms: budget }, signal)).json();
    const last = k === STAGES.length - 1 || reply.report.stopped_by !== "budget";
    show(reply, last);
    if (last) return;
  }
}

/** Lets the browser save a blob as a file. */
export function download(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
