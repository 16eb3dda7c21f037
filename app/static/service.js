// Questions to the service, and its problems as sentences.

export class Problem extends Error {
  constructor(status, body) {
    const rows = (body?.errors ?? []).map((row) => `${(row.pointer ?? "").replace(/^#\/?/, "").replaceAll("/", " ") || "request"}: ${row.detail}`);
    super(rows.length ? rows.slice(0, 3).join("; ") : body?.detail ?? `The service answered with ${status}.`);
    this.status = status;
  }
}

export async function ask(path, body, signal) {
  let reply;
  try {
    reply = await fetch(path, { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body), signal });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Error("The service cannot be reached.");
  }
  if (reply.ok) return reply;
  throw new Problem(reply.status, await reply.json().catch(() => null));
}

export const STAGES = [120, 1000, 5000];
/** Budgets in milliseconds, one after the other: something to look at soon, then as good as it gets. */

/** Asks again with more time as long as the budget was what ended the search; `show(reply)` gets each answer. */
export async function solve(request, show, signal) {
  let spent = 0;
  for (const [k, budget] of STAGES.entries()) {
    const reply = await (await ask("/v1/synthesize", { ...request, budget_ms: budget }, signal)).json();
    spent += reply.report.elapsed_ms.total;
    const last = k === STAGES.length - 1 || reply.report.stopped_by !== "budget";
    show(reply, last, spent);
    if (last) return;
  }
}

export function download(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
