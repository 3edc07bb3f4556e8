// The frames of a drive: a row of ticks for each camera, a slider over the frames of one.

import { emptied } from "/static/canvas.js";
import { $, ask, said, words } from "/static/frame.js";

const text = words.panel;
const ROW = 26, LEFT = 46;
const GOOD = "kept";

export class Times {
  constructor(choose) {
    this.choose = choose;
    this.cameras = [];
    this.strip = $("strip");
    if (!this.strip) return;
    $("times-camera").addEventListener("change", () => this.slide());
    $("moment").addEventListener("input", () => this.show());
    this.strip.addEventListener("click", (event) => this.click(event));
    new ResizeObserver(() => this.draw()).observe(this.strip);
    this.renew();
  }

  async renew() {
    if (!this.strip) return;
    const answer = await ask("/images/times");
    if (answer.status !== 200) return;
    this.cameras = answer.cameras;
    this.last = Math.max(...this.cameras.map((one) => one.times.at(-1) ?? 0), 0.001);
    const select = $("times-camera"), before = select.value;
    select.replaceChildren(...this.cameras.map((one) => new Option(one.camera, one.camera)));
    if (this.cameras.some((one) => one.camera === before)) select.value = before;
    this.slide(Number($("moment").value));
    this.strip.style.height = `${ROW * this.cameras.length + 6}px`;
    this.draw();
  }

  get camera() { return this.cameras.find((one) => one.camera === $("times-camera").value); }

  // The slider over the frames of the chosen camera, at its moment of before.
  slide(at = null) {
    if (!this.camera) return;
    const time = this.time ?? 0;
    $("moment").max = this.camera.times.length - 1;
    $("moment").value = at ?? nearest(this.camera.times, time);
    if (at === null) this.show();
    else this.tell();
  }

  show() {
    this.time = this.camera.times[Number($("moment").value)];
    this.tell();
    clearTimeout(this.resting);
    this.resting = setTimeout(() => this.choose(this.camera.images[Number($("moment").value)]), 80);
  }

  tell() {
    const { camera, times, verdicts } = this.camera;
    const at = Number($("moment").value);
    const content = said(text.times_told, { camera, number: at + 1, count: times.length, time: times[at].toFixed(2), verdict: verdicts[at] || text.times_unknown });
    $("times-told").textContent = content;
    $("moment").setAttribute("aria-valuetext", content);
    this.draw();
  }

  click(event) {
    const box = this.strip.getBoundingClientRect();
    const row = Math.min(Math.max(Math.floor((event.clientY - box.top) / ROW), 0), this.cameras.length - 1);
    this.time = Math.max((event.clientX - box.left - LEFT) / (box.width - LEFT - 8), 0) * this.last;
    $("times-camera").value = this.cameras[row].camera;
    this.slide();
  }

  draw() {
    const { strip } = this;
    if (!strip.clientWidth || !this.cameras.length) return;
    const [pen, width] = emptied(strip);
    const across = (time) => LEFT + (time / this.last) * (width - LEFT - 8);
    this.cameras.forEach((one, row) => {
      const middle = row * ROW + ROW / 2 + 3;
      pen.font = "600 13px system-ui, sans-serif";
      pen.fillStyle = "#1b1f24";
      pen.fillText(one.camera, 6, middle + 4, LEFT - 10);
      one.times.forEach((time, at) => {
        const isGood = one.verdicts[at] === GOOD, x = across(time);
        pen.fillStyle = isGood ? "#0067a8" : "#a0306f";
        const tall = isGood ? 8 : one.verdicts[at] ? 4 : 2;
        pen.fillRect(x - 0.75, middle - tall, 1.5, 2 * tall);
      });
      if (one !== this.camera || this.time === undefined) return;
      pen.strokeStyle = "#000";
      pen.lineWidth = 2;
      pen.strokeRect(across(one.times[Number($("moment").value)]) - 4, middle - 10, 8, 20);
    });
  }
}

function nearest(times, time) {
  let best = 0;
  times.forEach((one, at) => { if (Math.abs(one - time) < Math.abs(times[best] - time)) best = at; });
  return best;
}
