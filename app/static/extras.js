// What the reader puts on the canvas besides the motion: ghosts, snapping, outline, a picture to trace; and the legend.

import { element } from "./drawing.js";
import { typed } from "./decimal.js";
import { readOutline } from "./outline.js";
import { $, say } from "./shell.js";

const MAX_BYTES = 5e6;

/** What the canvas shows of a linkage of any kind by its joints; null stands for a four-bar. */
function parts(joints) {
  const { links, rails, slots, ground } = joints ?? { links: [true, true], rails: [], slots: [], ground: true };
  const found = [
    links[0] && ["crank", "crank AD"],
    ["body", "body DCP"],
    slots.length && ["body", `slot${slots.length > 1 ? "s" : ""} in the body`],
  ];
  found.push(
    links[1] && ["rocker", links[0] ? "rocker BC" : "crank BC"],
    rails.length && ["rail", `rail${rails.length > 1 ? "s" : ""}`],
    ground && ["ground", "ground AB"],
  );
  return [...found.filter(Boolean), ["path", "path of P"], ["pose", "wanted"], ["bad", "error"]];
}

function legend(joints) {
  const shown = parts(joints),
    words = shown.map((one) => one[1]).join(),
    list = $("legend");
  if (list.dataset.shown === words) return;
  list.dataset.shown = words;
  list.replaceChildren(
    ...shown.map(([name, said]) => {
      const item = element("li", "", said);
      item.prepend(element("span", `swatch ${name}`));
      return item;
    }),
  );
}

/** A picture behind the canvas, `width` units wide, its middle at `at`. It is painted, not loaded by an address. */
class Backdrop {
  constructor(board) {
    Object.assign(this, { board, picture: null, width: 100, at: [0, 0] });
    board.redrawn.push((view) => this.#draw(view));
  }

  async open(file) {
    this.picture = await createImageBitmap(file);
    const { view } = this.board;
    this.at = [view.cx, view.cy];
    this.width = Number(((0.8 * view.width) / view.scale).toPrecision(3));
    this.board.draw();
  }

  clear() {
    this.picture = null;
    this.board.draw();
  }

  #draw(view) {
    const canvas = $("backdrop"),
      ratio = devicePixelRatio,
      wide = Math.round(view.width * ratio),
      tall = Math.round(view.height * ratio);
    canvas.hidden = !this.picture;
    if (!this.picture) return;
    if (canvas.width !== wide || canvas.height !== tall) Object.assign(canvas, { width: wide, height: tall });
    const pen = canvas.getContext("2d"),
      [x, y] = view.at(this.at),
      w = this.width * view.scale,
      h = (w * this.picture.height) / this.picture.width;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, view.width, view.height);
    pen.drawImage(this.picture, x - w / 2, y - h / 2, w, h);
  }
}

/** Binds the panel of the canvas; `edit` changes the motion, `setMode` the mode of the canvas. */
export function startStage(board, edit, setMode) {
  const backdrop = new Backdrop(board);
  legend(null);
  board.seen.push(() => legend(board.linkage && board.joints));
  $("show-menu").addEventListener("click", () => {
    $("show-panel").hidden = !$("show-panel").hidden;
    $("show-menu").setAttribute("aria-expanded", String(!$("show-panel").hidden));
  });
  for (const name of ["ghosts", "snap"])
    $(name).addEventListener("change", () => {
      board[name] = $(name).checked;
      board.draw();
    });
  $("names").addEventListener("change", () => $("canvas").classList.toggle("unnamed", !$("names").checked));
  const choose = (button, input, take) => {
    $(button).addEventListener("click", () => $(input).click());
    $(input).addEventListener("change", async () => {
      const [file] = $(input).files;
      $(input).value = "";
      if (!file) return;
      try {
        if (file.size > MAX_BYTES) throw new Error("The file is larger than 5 MB.");
        await take(file);
      } catch (error) {
        say(error.name === "InvalidStateError" ? "The picture cannot be read." : error.message, true);
      }
    });
  };
  choose("outline-open", "outline-file", async (file) => {
    const outline = readOutline(await file.text(), file.name);
    edit((motion) => {
      motion.outline = outline;
    });
    $("ghosts").checked = board.ghosts = true;
    board.draw();
  });
  $("outline-draw").addEventListener("click", () => setMode("outline"));
  $("outline-clear").addEventListener("click", () =>
    edit((motion) => {
      motion.outline = null;
    }),
  );
  choose("picture-open", "picture-file", async (file) => {
    await backdrop.open(file);
    $("picture-width").value = backdrop.width;
  });
  $("picture-width").addEventListener("input", () => {
    const value = typed($("picture-width").value);
    if (value > 0) {
      backdrop.width = value;
      board.draw();
    }
  });
  for (const [k, name] of ["x", "y"].entries())
    $(`picture-${name}`).addEventListener("input", () => {
      const value = typed($(`picture-${name}`).value);
      if (Number.isFinite(value)) {
        backdrop.at[k] = value;
        board.draw();
      }
    });
  $("picture-clear").addEventListener("click", () => backdrop.clear());
}
