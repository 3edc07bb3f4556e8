// The first corner of the reference pattern and its row, clicked, touched or gone to by keys.

import { $, said, words } from "/static/frame.js";

const text = words.panel;
const NEAR = 28; // screen pixels within which a possible corner is meant
const narrow = matchMedia("(max-width: 60rem)");
const ALONG = Math.SQRT1_2; // a row and what is clicked along it are less than 45 degrees apart

export class Corner {
  constructor(picture, take, forget) {
    this.picture = picture;
    $("corner-take").addEventListener("click", () => { if (!$("corner-take").disabled) take(this.picture.picked); });
    $("corner-next").addEventListener("click", () => this.next());
    $("corner-leave").addEventListener("click", () => this.end(true));
    $("corner-forget").addEventListener("click", forget);
  }

  get isOn() { return this.picture.picked !== null; }

  get readings() { return this.picture.look?.readings ?? []; }

  begin(look) {
    if (look.readings?.length === 1) { $("said").textContent = text.corner_none; return; }
    const { picture } = this;
    picture.picked = { cursor: null, corner: null, axis: null, across: null };
    picture.canvas.classList.add("picking");
    $("picking").hidden = false;
    $("decide").hidden = true;
    $("corner-next").hidden = !this.readings.length;
    $("corner-forget").hidden = !look.corner;
    this.at = -1;
    if (look.corner) this.set(look.corner.places[0], look.corner.places[1] ?? null);
    else this.tell(text.corner_first, false);
    picture.canvas.focus({ preventScroll: true });
    if (narrow.matches) $("image-title").scrollIntoView(); // the card stands below the picture
    else $("picking").scrollIntoView({ block: "nearest" });
    picture.draw();
  }

  end(focus = false) {
    this.picture.picked = null;
    this.picture.canvas.classList.remove("picking");
    $("picking").hidden = true;
    $("decide").hidden = false;
    this.picture.draw();
    if (focus) $("corner").focus();
  }

  tell(content, ready) {
    $("corner-told").textContent = content;
    $("corner-take").disabled = !ready;
    this.picture.draw();
  }

  // A place that was clicked: a possible corner where one is near, else the row, else any corner.
  click(place) {
    const { picked, scale } = this.picture;
    const far = (one) => Math.hypot(one[0] - place[0], one[1] - place[1]) * scale;
    const near = this.readings.findIndex(([first]) => far(first) < NEAR);
    if (near >= 0) this.read(near);
    else if (picked.corner && far(picked.corner) >= NEAR) this.row(place);
    else this.set(place, null);
  }

  read(at) {
    this.at = at;
    const [first, along, across] = this.readings[at];
    this.set(first, along, across);
  }

  next() { this.read((this.at + 1) % this.readings.length); }

  set(corner, axis, across = null) {
    const [x, y] = corner.map(Math.round);
    Object.assign(this.picture.picked, { corner, axis, across });
    this.tell(said(axis ? text.corner_ready : text.corner_axis, { x, y }), true);
  }

  row(place) {
    const { picked } = this.picture;
    const arm = (end) => [end[0] - picked.corner[0], end[1] - picked.corner[1]];
    const reading = this.readings.find(([first]) => first[0] === picked.corner[0] && first[1] === picked.corner[1]);
    if (reading) {
      const [a, b] = [arm(reading[1]), arm(place)];
      if (a[0] * b[0] + a[1] * b[1] < ALONG * Math.hypot(...a) * Math.hypot(...b)) { this.tell(text.corner_wrong_axis, false); return; }
    }
    picked.axis = place;
    const [x, y, axis_x, axis_y] = [...picked.corner, ...place].map(Math.round);
    this.tell(said(text.corner_ready_axis, { x, y, axis_x, axis_y }), true);
  }

  // The cross moved by pixels of the image.
  step(x, y) {
    const { picked, size } = this.picture;
    const from = picked.cursor ?? picked.corner ?? this.picture.centre.map(Math.round);
    picked.cursor = [from[0] + x, from[1] + y].map((value, axis) => Math.min(Math.max(value, 0), size[axis] - 1));
    this.picture.draw();
  }

  // Enter: the place of the cross is taken; without one, what is chosen is used.
  enter(take) {
    const { picked } = this.picture;
    if (picked.cursor) { const place = picked.cursor; picked.cursor = null; this.click(place); }
    else if (!$("corner-take").disabled) take(picked);
  }
}
