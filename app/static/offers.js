// What a note of a reply offers to change in the request: the family, the order, or the value of a limit.

import { button } from "./drawing.js";
import { $ } from "./shell.js";

import { limitName } from "./verdict.js";

/** Whether a note belongs beside the error of the best linkage: no linkage comes near, or another order is much nearer. */
export const matters = (note) => note.startsWith("No linkage that was found comes near") || note.endsWith("(`order`).");

/**
 * [words, request] of a button for what a note offers, or null; the names in its parentheses say which field of the request it is
 * about. `found`: whether there are solutions.
 */
function offered(note, request, found) {
  const [, fields = ""] = /\(([^()]*)\)\.$/.exec(note) ?? [],
    [, name] = /^`limits\.(\w+)`$/.exec(fields) ?? [];
  if (fields === "`order`") return ["Pass them in any order", { ...request, order: "any" }];
  if (name === "family") return ["Allow any family", { ...request, limits: { ...request.limits, family: "any" } }];
  if (found || !name) return null;
  const [, clause] = /; with ([^;]*) there is one /.exec(note) ?? [],
    [value] = /\[.*\]|-?\d[\d.]*(?:e[-+]?\d+)?/.exec(clause ?? "") ?? [];
  if (value)
    return [
      `Set ${limitName(name)} to ${value}${clause.includes(" degrees") ? "°" : ""}`,
      { ...request, limits: { ...request.limits, [name]: JSON.parse(value) } },
    ];
  const { [name]: dropped, ...limits } = request.limits ?? {};
  return dropped === undefined ? null : [`Drop ${limitName(name)}`, { ...request, limits }];
}

/** Offers what the notes of an answer suggest, as buttons that call `use` with another request. */
export function showOffers({ reply: { report, solutions }, request }, use) {
  const all = report.notes.map((one) => offered(one, request, solutions.length > 0)).filter(Boolean);
  const found = all.filter(([words], k) => all.findIndex(([other]) => other === words) === k);
  $("suggestions").hidden = !found.length;
  $("suggestions").replaceChildren(...found.map(([words, eased]) => button(words, () => use(eased))));
}
