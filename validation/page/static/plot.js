// Two signals over time on a canvas: zoom and pan by wheel, fingers and keys; and a part of the
// second one, whose edges and place are dragged. Seconds since the first pose of the reference.

import { Drawing, emptied } from "/static/canvas.js";

const COLOURS = { reference: "#1b1f24", source: "#0067a8", part: "#c75000", band: "#e3e6ea", grid: "#e4e8ec", edge: "#57606a", quiet: "#57606a" };
const LEFT = 52, RIGHT = 18, BOTTOM = 26, TOP = 8; // pixels for the numbers
const GRAB = 16; // pixels within which an edge is meant
const SHORTEST = 2; // seconds that a view shows at least

export class Plot extends Drawing {
  // dragged: told of the part while it is dragged, and whether it rests; looked: of a new view.
  constructor(canvas, dragged, looked) {
    super(canvas);
    this.dragged = dragged;
    this.looked = looked;
    this.signal = "heading";
    this.unit = "";
    this.delay = 0; // seconds that all of the source is moved by, where it is shown aligned
    this.part = null; // { first, last, moved }
    this.view = [0, 1];
    this.whole = [0, 1];
    this.pointers = new Map();
    new ResizeObserver(() => this.draw()).observe(canvas);
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-Math.sign(event.deltaY) * Math.min(Math.abs(event.deltaY), 120) / 300), this.time(this.x(event)));
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => this.press(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => this.release(event));
  }

  show(signals) {
    const ends = [...signals.span, ...signals.own_span];
    this.signals = signals;
    this.whole = [Math.min(...ends), Math.max(...ends)];
    this.fit();
  }

  x(event) { return event.clientX - this.canvas.getBoundingClientRect().left; }
  get width() { return Math.max(this.canvas.clientWidth - LEFT - RIGHT, 1); }
  time(x) { return this.view[0] + ((x - LEFT) / this.width) * (this.view[1] - this.view[0]); }
  across(time) { return LEFT + ((time - this.view[0]) / (this.view[1] - this.view[0])) * this.width; }

  look(first, last) {
    const [low, high] = this.whole;
    const long = Math.min(Math.max(last - first, SHORTEST), high - low);
    const from = Math.min(Math.max((first + last - long) / 2, low), high - long);
    this.view = [from, from + long];
    this.draw();
    clearTimeout(this.looking);
    this.looking = setTimeout(() => this.looked(this.view), 200);
  }

  fit() { this.look(...this.whole); }

  zoom(factor, about = (this.view[0] + this.view[1]) / 2) {
    const [first, last] = this.view;
    this.look(about - (about - first) / factor, about + (last - about) / factor);
  }

  pan(share) {
    const by = share * (this.view[1] - this.view[0]);
    this.look(this.view[0] + by, this.view[1] + by);
  }

  toPart() {
    if (!this.part) return;
    const { first, last, moved } = this.part, rim = Math.max((last - first) * 0.15, 0.5);
    this.look(first + moved - rim, last + moved + rim);
  }

  // What is under a place: an edge of the part, the part itself, or nothing.
  under(x) {
    if (!this.part) return "";
    const [a, b] = [this.part.first, this.part.last].map((time) => this.across(time + this.part.moved));
    if (Math.abs(x - a) < GRAB && Math.abs(x - a) <= Math.abs(x - b)) return "first";
    if (Math.abs(x - b) < GRAB) return "last";
    return x > a && x < b ? "moved" : "";
  }

  press(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, this.x(event));
    this.grabbed = this.pointers.size === 1 ? this.under(this.x(event)) : "";
    this.wasDragged = false;
  }

  move(event) {
    const now = this.x(event), before = this.pointers.get(event.pointerId);
    if (before === undefined) {
      const under = this.under(now);
      this.canvas.classList.toggle("edge", under === "first" || under === "last" || under === "moved");
      return;
    }
    const [other] = [...this.pointers].filter(([id]) => id !== event.pointerId).map(([, x]) => x);
    this.pointers.set(event.pointerId, now);
    const step = ((now - before) / this.width) * (this.view[1] - this.view[0]);
    if (other !== undefined) this.zoom(Math.abs(now - other) / Math.max(Math.abs(before - other), 1), this.time((now + other) / 2));
    else if (!this.grabbed) this.look(this.view[0] - step, this.view[1] - step);
    else {
      const part = { ...this.part };
      part[this.grabbed] += step;
      if (part.last - part.first < 0.2) return;
      this.wasDragged = true;
      this.part = part;
      this.dragged(part, false);
      this.draw();
    }
  }

  release(event) {
    if (!this.pointers.delete(event.pointerId)) return;
    if (this.wasDragged && !this.pointers.size) { this.wasDragged = false; this.dragged(this.part, true); }
    this.grabbed = "";
  }

  paint() {
    const { canvas, signals } = this;
    const [pen, width, height] = emptied(canvas);
    if (!signals) return;
    const tall = height - TOP - BOTTOM;
    const [low, high] = this.range();
    const up = (value) => TOP + tall * (1 - (value - low) / (high - low));
    if (this.part) this.band(pen, tall);
    this.grid(pen, low, high, up, height);
    pen.save();
    pen.beginPath();
    pen.rect(LEFT, TOP, this.width, tall);
    pen.clip();
    this.line(pen, signals.reference, up);
    this.dots(pen, signals.source, up);
    pen.restore();
  }

  // The values that both show in the view, with a margin.
  range() {
    let [low, high] = [Infinity, -Infinity];
    for (const [one, delay] of [[this.signals.reference, 0], [this.signals.source, this.delay]]) {
      one[this.signal].forEach((value, at) => {
        const time = one.times[at] + delay;
        if (value === null || time < this.view[0] || time > this.view[1]) return;
        if (value < low) low = value;
        if (value > high) high = value;
      });
    }
    if (!(high >= low)) return [0, 1];
    const rim = Math.max((high - low) * 0.06, 0.01);
    return [low - rim, high + rim];
  }

  band(pen, tall) {
    const { first, last, moved } = this.part;
    const [a, b] = [this.across(first + moved), this.across(last + moved)].map((x) => Math.min(Math.max(x, LEFT), LEFT + this.width));
    pen.fillStyle = COLOURS.band;
    pen.fillRect(a, TOP, b - a, tall);
    pen.fillStyle = COLOURS.edge;
    for (const x of [this.across(first + moved), this.across(last + moved)]) {
      if (x < LEFT - 1 || x > LEFT + this.width + 1) continue;
      pen.fillRect(x - 1.5, TOP, 3, tall);
      pen.beginPath();
      pen.roundRect(x - 5, TOP + tall / 2 - 16, 10, 32, 5);
      pen.fill();
    }
  }

  grid(pen, low, high, up, height) {
    pen.font = "13px system-ui, sans-serif";
    pen.lineWidth = 1;
    const many = Math.max(Math.floor(this.width / 90), 2);
    for (const [from, to, count, isTime] of [[...this.view, many, true], [low, high, 5, false]]) {
      const step = steps((to - from) / count);
      for (let value = Math.ceil(from / step) * step; value <= to; value += step) {
        pen.strokeStyle = COLOURS.grid;
        pen.beginPath();
        if (isTime) { const x = this.across(value); pen.moveTo(x, TOP); pen.lineTo(x, height - BOTTOM); }
        else { pen.moveTo(LEFT, up(value)); pen.lineTo(LEFT + this.width, up(value)); }
        pen.stroke();
        pen.fillStyle = COLOURS.quiet;
        const text = Number(value.toPrecision(10)).toString().replace("-", "−");
        pen.textAlign = isTime ? "center" : "right";
        if (isTime) pen.fillText(`${text} s`, this.across(value), height - 8);
        else pen.fillText(text, LEFT - 6, up(value) + 4);
      }
    }
    pen.textAlign = "left";
    pen.fillText(this.unit, LEFT + 6, TOP + 13);
  }

  line(pen, one, up) {
    const breaks = new Set(one.breaks);
    let isOpen = false;
    pen.strokeStyle = COLOURS.reference;
    pen.lineWidth = 1.8;
    pen.beginPath();
    one.times.forEach((time, at) => {
      const value = one[this.signal][at];
      if (value === null) { isOpen = false; return; }
      if (isOpen) pen.lineTo(this.across(time), up(value));
      else pen.moveTo(this.across(time), up(value));
      isOpen = !breaks.has(at);
    });
    pen.stroke();
  }

  // The source as dots; those of the part are moved with it, and squares.
  dots(pen, one, up) {
    const { part } = this;
    one.times.forEach((time, at) => {
      const value = one[this.signal][at];
      if (value === null) return;
      const isIn = part && time >= part.first && time <= part.last;
      const x = this.across(time + (isIn ? part.moved : this.delay));
      pen.fillStyle = isIn ? COLOURS.part : COLOURS.source;
      if (isIn) pen.fillRect(x - 2.2, up(value) - 2.2, 4.4, 4.4);
      else { pen.beginPath(); pen.arc(x, up(value), 1.9, 0, 7); pen.fill(); }
    });
  }
}

// A round step, at least as large.
function steps(least) {
  const power = 10 ** Math.floor(Math.log10(Math.max(least, 1e-9)));
  return [1, 2, 5, 10].map((one) => one * power).find((one) => one >= least * 0.999);
}
