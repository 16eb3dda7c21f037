// HTTP calls to the service: one request, the staged search, error replies as sentences, downloads.

import { build, capital } from "./shell.js";
import { plainWords } from "./verdict.js";

/** Budgets of the search in milliseconds, one after the other: a first answer soon, then the final one. */
export const STAGES = [100, 5000];
const LONGER = 20000; // of a last stage, where nothing was found by then
const SHARE = 0.8; // of a budget, which a search that ended by itself did not use up

/** Return the error message for a wrong field, which the error reply names by a pointer. */
function faultOf({ pointer = "", detail }) {
  const path = pointer.replace(/^#?\/?/, "").replaceAll("/", " "),
    field = path.replace(/(?<= )\d+\b/g, (k) => +k + 1) || "request"; // the user counts from 1
  return `${field}: ${detail}`;
}

/** An error reply (problem+json) of the service; the message names at most three wrong fields. */
class Problem extends Error {
  constructor(status, body) {
    const rows = body?.errors ?? [],
      faults = rows.slice(0, 3).map(faultOf).join("; "),
      message = faults || body?.detail || `The service answered with ${status}`;
    super(capital(plainWords(`${message}${/[.!?]$/.test(message) ? "" : "."}`)));
    Object.assign(this, { status, rows });
  }
}

/** POSTs `body` as JSON. Throws Error with a sentence for the user, or the signal's AbortError. */
export async function ask(path, body, signal) {
  const headers = { "content-type": "application/json" };
  let reply;
  try {
    reply = await fetch(path, { method: "POST", headers, body: JSON.stringify(body), signal });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    const why = "The service cannot be reached. Is it still running? Nothing was lost here: start it and try again.";
    throw new Error(why, { cause: error });
  }
  if (reply.ok) return reply;
  throw new Problem(reply.status, await reply.json().catch(() => null));
}

const faulty = ({ verdict }) => ["order", "branch", "circuit"].some((name) => verdict?.[name] === false);
const outside = ({ verdict }) => verdict?.within_tolerance === false;
const objective = ({ errors }) => (errors.objective < 1e-10 ? 0 : errors.objective);
const rounded = (solution) => solution.rounded?.errors?.objective ?? Infinity;

/** Return the preference that ranks the solutions of a request: its `prefer`, or the service's default. */
export function preferred({ prefer, timing, tolerances, position, limits, round_to, lengths_from }) {
  if (prefer) return prefer;
  if (timing === "free" && limits?.preset !== "none" && !round_to && !lengths_from) return "balanced";
  return tolerances && position ? "size" : "error";
}

/** Compares two solutions: above 0 where the first is worse. Other preferences are the service's to say. */
const comparison = (request) => (a, b) => {
  const error = request.round_to || request.lengths_from ? rounded : objective,
    nearer = preferred(request) === "error" ? error(a) - error(b) : 0;
  return faulty(a) - faulty(b) || outside(a) - outside(b) || nearer;
};

/** Merge at most `top` solutions of a reply, in its order, with the earlier solutions that it lacks by `isSame`. */
export function together(request, earlier, reply, top, isSame) {
  const all = [...reply.solutions],
    worse = comparison(request);
  for (const candidate of earlier.filter((before) => !reply.solutions.some((solution) => isSame(before, solution)))) {
    const at = all.findIndex((solution) => worse(candidate, solution) < 0);
    all.splice(at < 0 ? all.length : at, 0, candidate);
  }
  return all.slice(0, top).map((solution, k) => ({ ...solution, rank: k + 1 }));
}

/** Repeats the search with the next budget as long as the budget ended it; `show(reply, last)` gets each answer. */
export async function solve(request, show, signal, isSame) {
  let found = [];
  const worse = comparison(request);
  const budgets = [...STAGES, LONGER];
  for (const [k, budget] of budgets.entries()) {
    const reply = await (await ask("/v2/synthesize", { ...request, budget_ms: budget }, signal)).json(),
      [best] = reply.solutions,
      earlier = found.filter((solution) => !best || worse(solution, best) < 0);
    if (k) reply.solutions = together(request, earlier, reply, request.top ?? 10, isSame);
    // a search that its budget ends on the way to smaller linkages says what ended its first part
    const { stopped_by, elapsed_ms } = reply.report,
      ended = stopped_by !== "budget" && elapsed_ms.total < SHARE * budget;
    const last = ended || k === budgets.length - 1 || (k === STAGES.length - 1 && reply.solutions.length > 0);
    // nothing is proved by a search that its budget may have ended
    if (reply.status === "infeasible" && elapsed_ms.total >= budget) reply.status = "unknown";
    // what an earlier stage found stays found
    if (reply.solutions.length && !["reached", "closest"].includes(reply.status)) reply.status = "closest";
    found = [...reply.solutions];
    show(reply, last);
    if (last) return;
  }
}

/** Refines from the linkage of a request: one answer, for a descent that was cut short begins anew. */
export async function refine(request, signal) {
  return (await ask("/v2/synthesize", { ...request, budget_ms: STAGES.at(-1) }, signal)).json();
}

/** Lets the browser save a blob as a file. */
export function download(blob, name) {
  const link = build("a", { href: URL.createObjectURL(blob), download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
