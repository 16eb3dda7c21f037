// Optional contents of the canvas besides the motion: ghosts, snapping, outline, a picture to trace; and the legend.

import { typed } from "./decimal.js";
import { readOutline } from "./outline.js";
import { $, listen, say } from "./shell.js";

const MAX_BYTES = 5e6;

/** Shows in the legend what the canvas shows of a linkage of any kind by its joints. */
function legend({ p, links: [crank, rocker], rails, slots, ground }) {
  const body = { point: p, coupler: !p, slot: slots.length, rail: rails.length },
    shown = { ...body, crank, rocker: crank && rocker, second: !crank && rocker, ground };
  for (const item of $("legend").querySelectorAll("[data-part]")) item.hidden = !shown[item.dataset.part];
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
      [width, height] = [view.width, view.height].map((pixels) => Math.round(pixels * ratio));
    canvas.hidden = !this.picture;
    if (!this.picture) return;
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const pen = canvas.getContext("2d"),
      [x, y] = view.at(this.at),
      w = this.width * view.scale,
      h = (w * this.picture.height) / this.picture.width;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, view.width, view.height);
    pen.drawImage(this.picture, x - w / 2, y - h / 2, w, h);
  }
}

/** Bind the panel of the canvas; `edit` changes the motion, `setMode` its mode. Return {outline, picture} for files. */
export function startStage(board, edit, setMode) {
  const backdrop = new Backdrop(board);
  board.seen.push(() => board.linkage && board.joints && legend(board.joints));
  listen("show-menu", "click", () => {
    $("show-panel").hidden = !$("show-panel").hidden;
    $("show-menu").setAttribute("aria-expanded", String(!$("show-panel").hidden));
  });
  for (const name of ["ghosts", "snap"])
    listen(name, "change", () => {
      board[name] = $(name).checked;
      board.draw();
    });
  listen("names", "change", () => $("canvas").classList.toggle("unnamed", !$("names").checked));
  const choose = (press, input, take) => {
    const open = async (file) => {
      try {
        if (file.size > MAX_BYTES) throw new Error("The file is larger than 5 MB.");
        await take(file);
      } catch (error) {
        say(error.name === "InvalidStateError" ? "The picture cannot be read." : error.message, true);
      }
    };
    listen(press, "click", () => $(input).click());
    listen(input, "change", () => {
      const [file] = $(input).files;
      $(input).value = "";
      if (file) open(file);
    });
    return open;
  };
  const outline = choose("outline-open", "outline-file", async (file) => {
    const lines = readOutline(await file.text(), file.name);
    edit((motion) => (motion.outline = lines));
    $("ghosts").checked = board.ghosts = true;
    board.draw();
    say(`The lines of ${file.name} are the outline of the body, which is drawn at each pose and at the linkage.`);
  });
  listen("outline-draw", "click", () => setMode("outline"));
  listen("outline-clear", "click", () => edit((motion) => (motion.outline = null)));
  const picture = choose("picture-open", "picture-file", async (file) => {
    await backdrop.open(file);
    $("picture-width").value = backdrop.width;
    say(`${file.name} is shown behind the canvas: trace over it. Set its width and position under Show.`);
  });
  const placePicture = () => {
    const [width, x, y] = ["width", "x", "y"].map((name) => typed($(`picture-${name}`).value));
    if (width > 0) backdrop.width = width;
    if (Number.isFinite(x)) backdrop.at[0] = x;
    if (Number.isFinite(y)) backdrop.at[1] = y;
    board.draw();
  };
  for (const name of ["width", "x", "y"]) listen(`picture-${name}`, "input", placePicture);
  listen("picture-clear", "click", () => backdrop.clear());
  return { outline, picture };
}
