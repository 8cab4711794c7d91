// Two motions aligned in time: the curve of corresponding times, and the moment that is shown.
// Part of one script with the other viewer files.
"use strict";

class WarpPanel extends Panel {
  async prepare(data) {
    this.data = data;
    this.lasts = data.lasts.map((last) => Math.max(last, 1));
    const part = (selector) => this.part.querySelector(selector);
    this.now = part(".now");
    this.cross = part(".cross");
    this.pace = part("[data-part=pace]");
    part(".curve").setAttribute("points", data.first
      .map((time, k) => this.place(time, data.second[k]).map((value) => value.toFixed(2)).join(","))
      .join(" "));
    const ends = this.part.querySelectorAll(".end");
    [0, data.lasts[0], 0, data.lasts[1]].forEach((frame, k) => { ends[k].textContent = this.time(frame); });
    const svg = part("svg");
    svg.addEventListener("pointerdown", (event) => {
      const box = part(".frame").getBoundingClientRect();
      const share = Math.min(1, Math.max(0, (event.clientX - box.left) / box.width));
      this.viewer.pause();
      this.viewer.seek(this.shareOf(share * this.lasts[0]));
    });
  }

  // The place in the square, whose side is 100, of a pair of frames.
  place(first, second) {
    return [(100 * first) / this.lasts[0], 100 - (100 * second) / this.lasts[1]];
  }

  time(frame) {
    const { rate } = this.data;
    return rate ? `${(frame / rate).toFixed(2)} s` : String(Math.round(frame));
  }

  // The time of the view when the first motion is at a frame.
  shareOf(frame) {
    const [body] = this.viewer.bodies();
    if (!body.times) return frame / this.viewer.lastFrame();
    const [start, end] = [body.times[0], body.times[body.times.length - 1]];
    return (frame - start) / (end - start || 1);
  }

  seek() {
    const [first, second] = this.viewer.bodies().map((body) => body.place);
    if (second === undefined) return;
    const [x, y] = this.place(first, second);
    this.now.setAttribute("cx", x);
    this.now.setAttribute("cy", y);
    this.cross.setAttribute("d", `M${x} 100 V${y} H0`);
    const { names } = this.data;
    this.pace.textContent = `${names[0]} at ${this.time(first)}, ${names[1]} at ${this.time(second)}`;
  }
}
PANELS.warp = WarpPanel;
