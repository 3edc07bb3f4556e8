// An image on a canvas with lines over it: zoom and pan by wheel, fingers and keys. Places are
// pixels of the image, the middle of its first one at 0, 0.

import { Drawing, emptied } from "/static/canvas.js";

const COLOURS = { found: "#56b4e9", expected: "#e69f00", left: "#e88fbd", chosen: "#fff200" };
const MOST = 40; // screen pixels a pixel of the image
const TAP = 8; // screen pixels that a finger may slip
const SMALL = 1280, LARGE = 4096; // widths that are asked of the server
const LETTERS = "abcdefghijklmnopqrstuvwxyz";

export class Picture extends Drawing {
  constructor(canvas, tapped) {
    super(canvas);
    this.tapped = tapped; // told of a place that was clicked
    this.size = [1, 1];
    this.centre = [0, 0];
    this.scale = 1;
    this.shown = { found: true, expected: true, left: true };
    this.files = {};
    this.look = null;
    this.image = null;
    this.other = null; // the image of after, where this one is of before
    this.share = 0.5; // of the canvas that shows the one of before
    this.picked = null; // { cursor, corner, axis, across } while a corner is clicked
    this.pointers = new Map();
    new ResizeObserver(() => { if (this.isWhole) this.fit(); else this.draw(); }).observe(canvas);
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-Math.sign(event.deltaY) * Math.min(Math.abs(event.deltaY), 120) / 400), this.at(event));
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => this.press(event));
    canvas.addEventListener("pointermove", (event) => this.drag(event));
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => this.release(event));
  }

  // Another image, and for steadiness its partner. Nothing is shown until it has come.
  open(file, other = "") {
    this.files = { image: file, other };
    this.look = this.image = this.other = null;
    this.isLarge = false;
    this.isWhole = true;
    this.load("image", SMALL);
    if (other) this.load("other", SMALL);
    this.draw();
  }

  load(place, width) {
    const file = this.files[place], image = new Image();
    image.onload = () => {
      if (this.files[place] !== file) return; // another one was chosen meanwhile
      this[place] = image;
      if (place === "image" && !this.look) this.natural(image);
      this.draw();
    };
    image.onerror = () => this.failed?.(file);
    image.src = `/images/picture?${new URLSearchParams({ image: file, width })}`;
  }

  // The size until the server has said the true one: of the picture that came.
  natural(image) { this.size = [image.naturalWidth, image.naturalHeight]; this.fit(); }

  tell(look) {
    this.look = look;
    const same = this.size[0] === look.size[0];
    this.size = look.size;
    if (this.isWhole || !same) this.fit();
    this.draw();
  }

  at(event) {
    const box = this.canvas.getBoundingClientRect();
    return this.place(event.clientX - box.left, event.clientY - box.top);
  }

  place(x, y) { return [this.centre[0] + (x - this.canvas.clientWidth / 2) / this.scale, this.centre[1] + (y - this.canvas.clientHeight / 2) / this.scale]; }

  on([x, y]) { return [(x - this.centre[0]) * this.scale + this.canvas.clientWidth / 2, (y - this.centre[1]) * this.scale + this.canvas.clientHeight / 2]; }

  get whole() { return Math.min(this.canvas.clientWidth / this.size[0], this.canvas.clientHeight / this.size[1]); }

  fit() {
    this.centre = [(this.size[0] - 1) / 2, (this.size[1] - 1) / 2];
    this.scale = this.whole;
    this.isWhole = true;
    this.draw();
  }

  zoom(factor, about = this.centre) {
    const scale = Math.min(Math.max(this.scale * factor, this.whole), MOST);
    const left = this.scale / scale;
    this.centre = this.centre.map((value, axis) => about[axis] + (value - about[axis]) * left);
    this.scale = scale;
    this.isWhole = scale <= this.whole;
    if (this.isWhole) { this.fit(); return; }
    this.keep();
  }

  pan(x, y) {
    this.centre = [this.centre[0] + x / this.scale, this.centre[1] + y / this.scale];
    this.keep();
  }

  // The middle of the view stays on the image; pixels of the file come where they are needed.
  keep() {
    this.centre = this.centre.map((value, axis) => Math.min(Math.max(value, 0), this.size[axis] - 1));
    const dense = this.scale * (devicePixelRatio || 1);
    const there = this.image?.naturalWidth ?? Infinity;
    if (!this.isLarge && there < Math.min(this.size[0], LARGE) && dense * this.size[0] > 1.3 * there) {
      this.isLarge = true;
      this.load("image", LARGE);
      if (this.files.other) this.load("other", LARGE);
    }
    this.draw();
  }

  press(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
    if (this.pointers.size === 1) this.from = [event.clientX, event.clientY];
    else this.from = null; // two fingers click nothing
  }

  drag(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    const others = [...this.pointers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
    if (this.from && Math.hypot(now[0] - this.from[0], now[1] - this.from[1]) < TAP) return;
    this.from = null;
    this.pointers.set(event.pointerId, now);
    if (others.length) this.pinch(before, now, others[0]);
    else this.pan(before[0] - now[0], before[1] - now[1]);
  }

  pinch(before, now, other) {
    const arm = (place) => Math.hypot(place[0] - other[0], place[1] - other[1]);
    const box = this.canvas.getBoundingClientRect();
    this.zoom(arm(now) / Math.max(arm(before), 1), this.place((now[0] + other[0]) / 2 - box.left, (now[1] + other[1]) / 2 - box.top));
  }

  release(event) {
    if (!this.pointers.delete(event.pointerId)) return;
    if (event.type === "pointerup" && this.from && !this.pointers.size) this.tapped(this.at(event));
    this.from = null;
  }

  paint() {
    const { canvas } = this;
    const [pen, width, height] = emptied(canvas);
    pen.imageSmoothingEnabled = this.scale < 3;
    this.spread(pen, this.image);
    if (this.other) this.wipe(pen, width, height);
    if (this.look) this.lines(pen);
    if (this.picked) this.pick(pen, width, height);
  }

  // A picture over the place of its image, whatever its width.
  spread(pen, image) {
    if (!image?.complete || !image.naturalWidth) return;
    const [left, top] = this.on([-0.5, -0.5]);
    pen.drawImage(image, left, top, this.size[0] * this.scale, this.size[1] * this.scale);
  }

  wipe(pen, width, height) {
    const at = width * this.share;
    pen.save();
    pen.beginPath();
    pen.rect(at, 0, width - at, height);
    pen.clip();
    this.spread(pen, this.other);
    pen.restore();
    pen.fillStyle = "#000";
    pen.fillRect(at - 2, 0, 4, height);
    pen.fillStyle = "#fff";
    pen.fillRect(at - 1, 0, 2, height);
  }

  lines(pen) {
    const { look, shown } = this;
    for (const one of look.outlines) {
      if (shown.expected && one.expected.length) this.path(pen, one.expected, COLOURS.expected, [7, 5], false);
      if (shown.expected && one.axes.length) this.axes(pen, one.axes);
      if (!shown.found) continue;
      if (one.found.length) this.path(pen, one.found, COLOURS.found, [], true);
      for (const corner of [...one.found, ...one.corners]) this.cross(pen, this.on(corner), COLOURS.found);
      const named = one.found.length ? one.found : one.expected;
      if (named.length) this.name(pen, one.name, named, COLOURS.found);
    }
    if (!shown.left) return;
    const letters = lettersOf(look.left);
    for (const one of look.left) {
      if (one.outline.length > 1) this.path(pen, one.outline, COLOURS.left, [2, 4], true);
      else if (one.place) this.cross(pen, this.on(one.place), COLOURS.left, 6);
      if (one.place) this.name(pen, letters.get(one.reason), [one.place], COLOURS.left);
    }
  }

  path(pen, points, colour, dash, isClosed) {
    for (const [style, wide] of [["rgb(0 0 0 / .65)", 4.5], [colour, 2]]) {
      pen.strokeStyle = style;
      pen.lineWidth = wide;
      pen.setLineDash(style === colour ? dash : []);
      pen.beginPath();
      points.forEach((point, at) => { const [x, y] = this.on(point); if (at) pen.lineTo(x, y); else pen.moveTo(x, y); });
      if (isClosed) pen.closePath();
      pen.stroke();
    }
    pen.setLineDash([]);
  }

  cross(pen, [x, y], colour, arm = 4) {
    for (const [style, wide] of [["rgb(0 0 0 / .65)", 3.5], [colour, 1.5]]) {
      pen.strokeStyle = style;
      pen.lineWidth = wide;
      pen.beginPath();
      pen.moveTo(x - arm, y); pen.lineTo(x + arm, y); pen.moveTo(x, y - arm); pen.lineTo(x, y + arm);
      pen.stroke();
    }
  }

  name(pen, text, points, colour) {
    const top = points.map((point) => this.on(point)).reduce((one, two) => (two[1] < one[1] ? two : one));
    this.text(pen, text, top[0] + 5, top[1] - 5, colour);
  }

  text(pen, text, x, y, colour) {
    pen.font = "600 14px system-ui, sans-serif";
    pen.strokeStyle = "#000";
    pen.lineWidth = 3.5;
    pen.lineJoin = "round";
    pen.strokeText(text, x, y);
    pen.fillStyle = colour;
    pen.fillText(text, x, y);
  }

  axes(pen, [origin, ...tips]) {
    tips.slice(0, 2).forEach((tip, at) => this.arrow(pen, origin, tip, "xy"[at], COLOURS.expected));
  }

  arrow(pen, from, to, name, colour) {
    this.path(pen, [from, to], colour, [], false);
    const [a, b] = [this.on(from), this.on(to)];
    const along = Math.atan2(b[1] - a[1], b[0] - a[0]);
    pen.fillStyle = colour;
    pen.strokeStyle = "rgb(0 0 0 / .65)";
    pen.lineWidth = 2;
    pen.beginPath();
    pen.moveTo(b[0] + 9 * Math.cos(along), b[1] + 9 * Math.sin(along));
    for (const side of [2.5, -2.5]) pen.lineTo(b[0] + 9 * Math.cos(along + side), b[1] + 9 * Math.sin(along + side));
    pen.closePath();
    pen.stroke();
    pen.fill();
    this.text(pen, name, b[0] + 12, b[1] + 4, colour);
  }

  // What is being clicked: the possible corners, the one chosen with its row, and the cross of
  // the keyboard.
  pick(pen, width, height) {
    const { picked } = this;
    (this.look?.readings ?? []).forEach(([first], at) => this.ring(pen, this.on(first), 9, "#fff", String(at + 1)));
    if (picked.corner && picked.axis) this.arrow(pen, picked.corner, picked.axis, "x", COLOURS.chosen);
    if (picked.corner && picked.across) this.arrow(pen, picked.corner, picked.across, "y", "#fff");
    if (picked.corner) this.ring(pen, this.on(picked.corner), 13, COLOURS.chosen, "");
    if (!picked.cursor) return;
    const [x, y] = this.on(picked.cursor);
    pen.fillStyle = "#000";
    pen.fillRect(0, y - 1.5, width, 3); pen.fillRect(x - 1.5, 0, 3, height);
    pen.fillStyle = COLOURS.chosen;
    pen.fillRect(0, y - 0.5, width, 1); pen.fillRect(x - 0.5, 0, 1, height);
  }

  ring(pen, [x, y], size, colour, text) {
    for (const [style, wide] of [["#000", 5], [colour, 2.5]]) {
      pen.strokeStyle = style;
      pen.lineWidth = wide;
      pen.beginPath();
      pen.arc(x, y, size, 0, 7);
      pen.stroke();
    }
    if (text) this.text(pen, text, x + size + 3, y + size + 3, colour);
  }
}

// A letter for each reason that has a place, in their order.
export function lettersOf(left) {
  const reasons = [...new Set(left.filter((one) => one.place).map((one) => one.reason))];
  return new Map(reasons.map((reason, at) => [reason, LETTERS[at % LETTERS.length]]));
}
