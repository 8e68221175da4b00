// SPDX-License-Identifier: GPL-2.0-or-later
// Frames for a video or a picture, which pkm requests after # in the address.
import { shown } from "./elements.js";

/** Parses #frames=first,count,all,width,height,view: `count` frames from `first` of the `all` frames of a program. */
export function wanted() {
  const found = /^#frames=(\d+),(\d+),(\d+),(\d+),(\d+),(\w+)$/.exec(location.hash);
  if (!found) return undefined;
  const [first, count, all, width, height] = found.slice(1, 6).map(Number);
  return { first, count, all, width, height, view: found[6] };
}

export class Recorder {
  constructor(page) {
    this.page = page;
  }

  /** Draws the frames and replaces the page's content by them, where pkm reads them. */
  run({ first, count, all, width, height, view }) {
    const { page } = this;
    document.body.classList.add("recording");
    page.stage.resize(width, height);
    page.look(view);
    const sheet = document.createElement("canvas");
    Object.assign(sheet, { width, height });
    const frames = Array.from({ length: count }, (_, n) => {
      if (page.player && !page.program.isEmpty) page.player.go((page.program.end * (first + n)) / Math.max(all - 1, 1));
      page.stage.redraw();
      page.stage.draw();
      return this.frame(sheet).toDataURL("image/png");
    });
    const list = document.createElement("pre");
    list.id = "frames";
    list.textContent = frames.join("\n");
    document.body.replaceChildren(list);
  }

  frame(sheet) {
    const { page } = this;
    const pen = sheet.getContext("2d");
    pen.drawImage(page.canvas, 0, 0);
    const size = Math.round(sheet.height / 36);
    pen.font = `600 ${size}px sans-serif`;
    pen.fillStyle = "#16202a";
    pen.fillText(page.data.title, size, 1.8 * size);
    pen.font = `${0.85 * size}px sans-serif`;
    if (page.player && !page.program.isEmpty) {
      const { time, line, program } = page.player;
      pen.fillText(`${shown(time, 2)} s · line ${line}: ${program.text[line - 1]?.trim() ?? ""}`, size, sheet.height - size, sheet.width - 2 * size);
    }
    return sheet;
  }
}
