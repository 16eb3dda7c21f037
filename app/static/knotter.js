// The knotter's page: the verdicts over the first two axes of a scan.

import { facts } from "./answer.js";
import { text } from "./drawing.js";

const MOST_CELLS = 400;

/** A table of verdicts over the first two axes; none for more than `MOST_CELLS` cells. */
function verdicts(host, reply) {
  const [first, second] = reply.axes;
  const value = (pair, axis) => pair[axis] ?? pair.parameters?.[axis];
  const rows = [...new Set(reply.pairs.map((pair) => value(pair, first)))], columns = [...new Set(reply.pairs.map((pair) => value(pair, second)))];
  if (rows.length * columns.length > MOST_CELLS) return;
  const grid = document.createElement("table");
  grid.className = "verdicts";
  const caption = grid.createCaption();
  caption.className = "note";
  caption.textContent = `Rows vary ${first}, columns ${second}. Where further parameters vary, the combination with the largest margin is shown. The numbers are margins; positive if the condition holds.`;
  const head = grid.createTHead().insertRow();
  head.append(Object.assign(document.createElement("th"), { scope: "col", textContent: `${first} \\ ${second}` }));
  for (const column of columns) head.append(Object.assign(document.createElement("th"), { scope: "col", textContent: text(column, 5) }));
  const body = grid.createTBody();
  for (const row of rows) {
    const line = body.insertRow();
    line.append(Object.assign(document.createElement("th"), { scope: "row", textContent: text(row, 5) }));
    for (const column of columns) {
      const pairs = reply.pairs.filter((pair) => value(pair, first) === row && value(pair, second) === column);
      const pair = pairs.reduce((a, b) => (b.margin > a.margin ? b : a));
      const cell = line.insertCell();
      cell.className = pair.feasible ? "yes" : "no";
      cell.append(Object.assign(document.createElement("strong"), { textContent: pair.feasible ? "ties" : "fails" }));
      for (const name of ["wrap", "clearance", "bite"]) {
        if (!pair[name]) continue;
        cell.append(`${pair[name].holds ? "✓" : "✗"} ${name} ${text(pair[name].margin, 3)}`, document.createElement("br"));
      }
    }
  }
  const scroll = Object.assign(document.createElement("div"), { className: "scroll", tabIndex: 0 });
  scroll.setAttribute("role", "region");
  scroll.setAttribute("aria-label", "Verdicts");
  scroll.append(grid);
  host.append(scroll);
}

export const knotter = {
  show({ reply }, { facts: figures, tables }) {
    if (reply.pairs && reply.axes) verdicts(tables, reply);
    facts(figures, [["status", reply.status]]);
  },
};
