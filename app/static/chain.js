// The chain's page: the service's drawing of track and slot, and the slot's path enlarged.

import { facts } from "./answer.js";
import { grid, line, stage } from "./stage.js";

/** The drawing that the service exports as SVG. */
async function drawn(host, query, request) {
  const reply = await fetch(`${query.path}.svg`, { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(request) });
  const root = new DOMParser().parseFromString(await reply.text(), "image/svg+xml").documentElement;
  if (!reply.ok || root.nodeName !== "svg") return;
  root.setAttribute("role", "img");
  root.setAttribute("aria-label", root.querySelector("title")?.textContent ?? "Drawing");
  root.removeAttribute("width");
  root.removeAttribute("height");
  root.setAttribute("class", "paper");
  host.append(document.importNode(root, true));
}

export const chain = {
  async show({ query, request, reply }, { picture, facts: figures }) {
    await drawn(picture, query, request);
    const xy = reply.slot.xy;
    stage(picture, { label: "The slot's path", extent: xy, draw(layer, view) { grid(layer, view); line(layer, "curve", xy, view); } });
    facts(figures, [["status", reply.status], ["links", reply.links], ["pitch", reply.pitch]]);
  },
};
