// Two scans over each other on a canvas: zoom and pan, by wheel, fingers and keys; and the moving
// scan dragged and turned. Lengths in metres, the frame is that of the scan that stands.

import { Drawing, emptied } from "/static/canvas.js";

const COLOURS = { reference: "#c75000", moving: "#0067a8", contradicting: "#8f0052", grid: "#e4e8ec", ink: "#1b1f24" };
const STEPS = [[0.01, "#b9d7ea"], [0.03, "#e7a33e"], [Infinity, "#7a0043"]]; // light to dark
const NEAREST = 5000, FARTHEST = 4; // pixels a metre
const MOST_FIT = 130; // pixels a metre when a pair is first shown: a centimetre a pixel

export class Scans extends Drawing {
  constructor(canvas, changed) {
    super(canvas);
    this.changed = changed; // told of the pose while the scan is moved, and whether it rests
    this.centre = [0, 0];
    this.scale = 60;
    this.shown = { residuals: false, normals: false, contradictions: true };
    this.isMoving = false;
    this.pointers = new Map();
    this.pose = [0, 0, 0];
    new ResizeObserver(() => this.draw()).observe(canvas);
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      if (this.isMoving && event.shiftKey) this.step([0, 0, event.deltaY > 0 ? -1 : 1]);
      else this.zoom(Math.exp(-Math.sign(event.deltaY) * Math.min(Math.abs(event.deltaY), 120) / 400), this.at(event));
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => this.press(event));
    canvas.addEventListener("pointermove", (event) => this.drag(event));
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => this.release(event));
  }

  show(pair) {
    this.scans = pair.scans;
    this.match = pair.match;
    this.pose = [...pair.match.pose];
    this.fit();
  }

  // Place of an event on the floor.
  at(event) {
    const box = this.canvas.getBoundingClientRect();
    return this.place(event.clientX - box.left, event.clientY - box.top);
  }

  place(x, y) {
    return [this.centre[0] + (x - this.canvas.clientWidth / 2) / this.scale, this.centre[1] - (y - this.canvas.clientHeight / 2) / this.scale];
  }

  zoom(factor, about = this.centre) {
    const scale = Math.min(Math.max(this.scale * factor, FARTHEST), NEAREST);
    const left = this.scale / scale;
    this.centre = this.centre.map((value, axis) => about[axis] + (value - about[axis]) * left);
    this.scale = scale;
    this.draw();
  }

  fit() {
    if (!this.scans) return;
    const ends = [[], []];
    for (const [x, y] of this.ends()) { ends[0].push(x); ends[1].push(y); }
    const spans = ends.map((values) => {
      values.sort((a, b) => a - b);
      const cut = Math.floor(values.length * 0.01); // not for the sake of a few far points
      return [values[cut], values[values.length - 1 - cut]];
    });
    this.centre = spans.map(([low, high]) => (low + high) / 2);
    const wide = spans.map(([low, high]) => Math.max(high - low, 0.5) * 1.12);
    this.scale = Math.min(Math.max(Math.min(this.canvas.clientWidth / wide[0], this.canvas.clientHeight / wide[1]), FARTHEST), MOST_FIT);
    this.draw();
  }

  * ends() {
    const { reference, moving } = this.scans;
    for (let at = 0; at < reference.points.length; at += 2) yield [reference.points[at] / 1e3, reference.points[at + 1] / 1e3];
    for (let at = 0; at < moving.points.length; at += 2) yield this.moved(moving.points[at] / 1e3, moving.points[at + 1] / 1e3);
  }

  moved(x, y, pose = this.pose) {
    const c = Math.cos(pose[2]), s = Math.sin(pose[2]);
    return [pose[0] + c * x - s * y, pose[1] + s * x + c * y];
  }

  press(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
  }

  drag(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    const others = [...this.pointers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
    this.pointers.set(event.pointerId, now);
    if (others.length) this.pinch(before, now, others[0]);
    else {
      const step = [(now[0] - before[0]) / this.scale, -(now[1] - before[1]) / this.scale];
      if (!this.isMoving) this.centre = [this.centre[0] - step[0], this.centre[1] - step[1]];
      else if (event.shiftKey) this.turn((now[0] - before[0]) * 0.005);
      else this.put([this.pose[0] + step[0], this.pose[1] + step[1], this.pose[2]]);
    }
    this.draw();
  }

  // Two fingers: the picture is zoomed; the scan that is moved is turned.
  pinch(before, now, other) {
    const arm = (place) => [place[0] - other[0], place[1] - other[1]];
    const [a, b] = [arm(before), arm(now)];
    if (this.isMoving) this.turn(Math.atan2(a[1], a[0]) - Math.atan2(b[1], b[0]));
    else {
      const box = this.canvas.getBoundingClientRect();
      this.zoom(Math.hypot(...b) / Math.max(Math.hypot(...a), 1), this.place((now[0] + other[0]) / 2 - box.left, (now[1] + other[1]) / 2 - box.top));
    }
  }

  release(event) {
    if (this.pointers.delete(event.pointerId) && !this.pointers.size && this.isMoving) this.changed(this.pose, true);
  }

  // The moving scan turned about its sensor.
  turn(angle) { this.put([this.pose[0], this.pose[1], Math.atan2(Math.sin(this.pose[2] + angle), Math.cos(this.pose[2] + angle))]); }

  put(pose) {
    this.pose = pose;
    this.match = { ...this.match, residuals: null, contradicting: [[], []] };
    this.changed(pose, false);
  }

  // A step of a key or a button: metres, metres, degrees.
  step([x, y, degrees]) {
    if (degrees) this.turn(degrees * Math.PI / 180);
    else this.put([this.pose[0] + x, this.pose[1] + y, this.pose[2]]);
    this.draw();
    clearTimeout(this.resting);
    this.resting = setTimeout(() => this.changed(this.pose, true), 120);
  }

  pan(x, y) {
    this.centre = [this.centre[0] + x / this.scale, this.centre[1] + y / this.scale];
    this.draw();
  }

  paint() {
    const { canvas } = this;
    const [pen, width, height] = emptied(canvas);
    this.grid(pen, width, height);
    if (!this.scans) return;
    const size = Math.min(Math.max(this.scale / 45, 1.6), 5);
    const to = ([x, y]) => [(x - this.centre[0]) * this.scale + width / 2, (this.centre[1] - y) * this.scale + height / 2];
    const { reference, moving } = this.scans;
    const stands = places(reference.points).map(to);
    const moves = places(moving.points).map(([x, y]) => to(this.moved(x, y)));
    if (this.shown.normals) {
      this.lines(pen, stands, reference.normals, 0, COLOURS.reference);
      this.lines(pen, moves, moving.normals, this.pose[2], COLOURS.moving);
    }
    pen.fillStyle = COLOURS.reference;
    for (const [x, y] of stands) { pen.beginPath(); pen.arc(x, y, size, 0, 7); pen.fill(); }
    this.squares(pen, moves, size);
    if (this.shown.contradictions && this.match.contradicting) {
      const [ofMoving, ofReference] = this.match.contradicting;
      this.crosses(pen, ofMoving.map((at) => moves[at]), size);
      this.crosses(pen, ofReference.map((at) => stands[at]), size);
    }
    this.sensor(pen, to([0, 0]), 0, COLOURS.reference);
    this.sensor(pen, to(this.pose), this.pose[2], COLOURS.moving);
  }

  squares(pen, moves, size) {
    const values = this.shown.residuals ? this.match.residuals : null;
    pen.lineWidth = Math.max(size * 0.45, 1);
    pen.strokeStyle = COLOURS.moving;
    moves.forEach(([x, y], at) => {
      const value = values?.[at];
      if (values && value !== null) {
        pen.fillStyle = STEPS.find(([limit]) => Math.abs(value) / 1e3 < limit)[1];
        pen.fillRect(x - size * 1.3, y - size * 1.3, size * 2.6, size * 2.6);
        return;
      }
      pen.strokeRect(x - size, y - size, size * 2, size * 2);
    });
  }

  crosses(pen, marks, size) {
    const arm = size + 2.5;
    pen.strokeStyle = COLOURS.contradicting;
    pen.lineWidth = 1.8;
    pen.beginPath();
    for (const [x, y] of marks) {
      pen.moveTo(x - arm, y - arm); pen.lineTo(x + arm, y + arm);
      pen.moveTo(x + arm, y - arm); pen.lineTo(x - arm, y + arm);
    }
    pen.stroke();
  }

  lines(pen, from, normals, turned, colour) {
    const [c, s] = [Math.cos(turned), Math.sin(turned)];
    pen.strokeStyle = colour;
    pen.globalAlpha = 0.55;
    pen.lineWidth = 1;
    pen.beginPath();
    from.forEach(([x, y], at) => {
      const [nx, ny] = [normals[2 * at] / 100, normals[2 * at + 1] / 100];
      pen.moveTo(x, y);
      pen.lineTo(x + 14 * (c * nx - s * ny), y - 14 * (s * nx + c * ny));
    });
    pen.stroke();
    pen.globalAlpha = 1;
  }

  sensor(pen, [x, y], heading, colour) {
    pen.fillStyle = "#fff";
    pen.strokeStyle = colour;
    pen.lineWidth = 2.5;
    pen.beginPath();
    pen.arc(x, y, 6, 0, 7);
    pen.moveTo(x, y);
    pen.lineTo(x + 17 * Math.cos(heading), y - 17 * Math.sin(heading));
    pen.fill();
    pen.stroke();
  }

  grid(pen, width, height) {
    const step = [0.01, 0.1, 1, 10, 100].find((one) => one * this.scale >= 28) ?? 100;
    const [left, top] = this.place(0, 0), [right, bottom] = this.place(width, height);
    pen.strokeStyle = COLOURS.grid;
    pen.lineWidth = 1;
    pen.beginPath();
    for (let x = Math.ceil(left / step) * step; x < right; x += step) {
      const at = (x - this.centre[0]) * this.scale + width / 2;
      pen.moveTo(at, 0); pen.lineTo(at, height);
    }
    for (let y = Math.ceil(bottom / step) * step; y < top; y += step) {
      const at = (this.centre[1] - y) * this.scale + height / 2;
      pen.moveTo(0, at); pen.lineTo(width, at);
    }
    pen.stroke();
    this.bar?.(step, step * this.scale);
  }
}

function places(flat) {
  const found = new Array(flat.length / 2);
  for (let at = 0; at < found.length; at += 1) found[at] = [flat[2 * at] / 1e3, flat[2 * at + 1] / 1e3];
  return found;
}
