// The images of a campaign, one large, and what is decided about them. The server says what was
// found in an image and what was expected; here it is shown, gone through, and decided on.

import { $, ask, mark, replace, said, watch, words } from "/static/frame.js";
import { Outbox } from "/static/outbox.js";
import { Corner } from "./corner.js";
import { Picture, lettersOf } from "./picture.js";
import { Times } from "./times.js";

const text = words.panel;
const LETTERS = {
  j: () => go(1), k: () => go(-1), x: () => leaveOut(), p: () => pick(), u: () => undo(), f: () => toggle("found"), e: () => toggle("expected"), n: () => toggle("left"),
  "+": () => picture.zoom(1.5), "=": () => picture.zoom(1.5), "-": () => picture.zoom(1 / 1.5), 0: () => picture.fit(),
};

const picture = new Picture($("picture"), (place) => { if (corner.isOn) corner.click(place); });
const corner = new Corner(picture, takeCorner, () => decide("no-corner"));
const box = new Outbox("images", "/images/decide", ({ image }) => row(image)?.querySelector("b").textContent ?? image, (problem) => say(problem, true));
let shown = null; // what the server said of the image that is shown
let wanted = ""; // the image that was asked for last

// What is kept here because the link is lost has been said, and counts more.
picture.failed = (name) => { if (name === wanted && !box.all.length) say(text.no_picture, true); };

const rows = () => [...document.querySelectorAll("#images button")];
const seen = () => rows().filter((row) => !row.parentElement.hidden);
const row = (name) => rows().find((one) => one.dataset.image === name);

function item(list, content) {
  const one = document.createElement("li");
  one.textContent = content;
  list.append(one);
}

function say(content, bad = false) {
  $("said").textContent = content;
  $("said").className = bad ? "bad" : "";
}

// Show an image; the one that is shown already is only told of anew.
async function choose(name, focus = false) {
  if (!name) return;
  const isSame = shown?.image === name;
  wanted = name;
  const button = row(name);
  mark(rows(), button);
  button?.scrollIntoView({ block: "nearest" });
  if (focus) button?.focus();
  if (!isSame) {
    if (corner.isOn) corner.end();
    const place = button?.parentElement.dataset;
    const other = place && { before: "after", after: "before" }[place.purpose];
    const partner = other && rows().find((one) => one.parentElement.dataset.purpose === other && one.parentElement.dataset.camera === place.camera);
    $("wiping").hidden = !partner;
    if (partner && place.purpose === "after") picture.open(partner.dataset.image, name);
    else picture.open(name, partner?.dataset.image ?? "");
    $("image-title").textContent = button?.querySelector("b").textContent ?? name;
    $("verdict").textContent = text.looking;
  }
  const answer = await ask(`/images/look?${new URLSearchParams({ image: name })}`, undefined, 70);
  if (wanted !== name) return; // another one was chosen meanwhile
  if (answer.status !== 200) { $("verdict").textContent = ""; if (!box.all.length) say(answer.error ?? words.frame.no_server, true); return; }
  shown = answer;
  picture.tell(answer);
  tell();
}

function tell() {
  const look = shown;
  $("image-title").textContent = look.title;
  const parts = [];
  if (look.left_out) parts.push(said(text.decision_left_out, { by: look.left_out.by || text.somebody, note: look.left_out.note }).trim());
  if (look.corner) parts.push(said(text.decision_corner, { x: Math.round(look.corner.places[0][0]), y: Math.round(look.corner.places[0][1]), by: look.corner.by || text.somebody }));
  $("decision").hidden = !parts.length;
  $("decision").textContent = parts.join(" ");
  $("verdict").textContent = look.verdict || text.no_verdict;
  $("what-found").replaceChildren();
  for (const one of look.outlines) {
    const kind = one.off !== null ? text.one_both : one.found.length || one.corners.length ? text.one_found : text.one_expected;
    item($("what-found"), said(kind, { name: one.name, off: one.off }));
  }
  if (!look.outlines.length) item($("what-found"), text.nothing_found);
  $("what-left").replaceChildren();
  const letters = lettersOf(look.left);
  const groups = Map.groupBy ? Map.groupBy(look.left, (one) => one.reason) : grouped(look.left);
  for (const [reason, some] of groups) {
    const numbers = some.map((one) => one.number).filter((one) => one !== null).join(", ");
    const [{ kind }] = some;
    item($("what-left"), said(text.one_left, { letter: letters.get(reason) ?? "·", kind, number: numbers || (some.length > 1 ? `(${some.length})` : ""), reason }).replace("  ", " "));
  }
  if (!look.left.length) item($("what-left"), text.nothing_left);
  $("leave-out").textContent = look.left_out ? text.use : text.leave_out;
  $("corner").hidden = look.purpose !== "reference";
  const found = look.outlines.filter((one) => one.found.length || one.corners.length).length;
  const expected = look.outlines.filter((one) => one.expected.length).length;
  $("picture").setAttribute("aria-label", said(text.picture_told, { title: look.title, found, expected, left: look.left.length }));
}

function grouped(left) {
  const groups = new Map();
  for (const one of left) groups.set(one.reason, [...(groups.get(one.reason) ?? []), one]);
  return groups;
}

function go(by) {
  const some = seen();
  const at = some.findIndex((one) => one.hasAttribute("aria-current"));
  choose(some[Math.min(Math.max(at + by, 0), some.length - 1)]?.dataset.image, document.activeElement?.closest("#images") !== null);
}

function toggle(name) {
  const on = $(name).getAttribute("aria-pressed") !== "true";
  $(name).setAttribute("aria-pressed", on);
  picture.shown[name] = on;
  picture.draw();
}

// -- decisions ------------------------------------------------------------------------------

// About the image whose picture and name are shown, also before it has been looked at.
async function decide(decision, more = {}) {
  if (!wanted) return;
  const image = wanted, title = $("image-title").textContent;
  if (await box.add({ image, decision, ...more })) {
    say(said(text[`recorded_${decision}`], { title }));
    if (wanted !== image) return; // another one was chosen meanwhile
    if (corner.isOn) corner.end(true);
    const some = rows(), at = some.indexOf(row(image));
    const next = [...some.slice(at + 1), ...some.slice(0, Math.max(at, 0))].find((one) => one.parentElement.dataset.state === "corner");
    await choose(decision === "corner" && next ? next.dataset.image : image);
  }
}

function leaveOut() {
  if (!wanted) return;
  const state = row(wanted)?.parentElement.dataset.state;
  const isOut = shown?.image === wanted ? Boolean(shown.left_out) : state === "left_out";
  decide(isOut ? "use" : "leave-out");
}

function pick() {
  if (shown?.image !== wanted) { say(text.looking); return; }
  if (shown.purpose !== "reference") return;
  if (corner.isOn) corner.end(true);
  else corner.begin(shown);
}

function takeCorner(picked) {
  const round = (value) => Math.round(value * 100) / 100;
  const [x, y] = picked.corner.map(round);
  const [axis_x, axis_y] = picked.axis?.map(round) ?? [null, null];
  decide("corner", { x, y, axis_x, axis_y });
}

async function undo() {
  if (!(await box.flush())) return;
  const answer = await ask("/images/undo", {});
  if (answer.status !== 200) { say(answer.error ?? words.frame.no_server, true); return; }
  const names = answer.images.map((name) => row(name)?.querySelector("b").textContent ?? name);
  say(said(text.undone, { images: names.join(", ") }));
  if (answer.images[0]) choose(answer.images[0]);
}

// -- the list -------------------------------------------------------------------------------

let filter = "all", camera = "";

function filtered() {
  const select = $("filter");
  if (!select) return;
  if (![...select.options].some((one) => one.value === filter)) filter = "all";
  if (![...$("of-camera").options].some((one) => one.value === camera)) camera = "";
  select.value = filter;
  $("of-camera").value = camera;
  const [kind, name] = filter.split(":");
  let any = false;
  for (const one of document.querySelectorAll("#images li")) {
    one.hidden = (filter !== "all" && one.dataset[kind] !== name) || (camera !== "" && one.dataset.camera !== camera);
    any ||= !one.hidden;
  }
  $("none").hidden = any;
  mark(rows(), row(wanted));
}

async function renew() {
  const scrolled = [$("choose").scrollTop, $("images")?.scrollTop ?? 0];
  const again = document.activeElement?.closest("#images button")?.dataset.image;
  if (!(await replace("choose", "/images/list"))) return;
  filtered();
  $("choose").scrollTop = scrolled[0];
  if ($("images")) $("images").scrollTop = scrolled[1];
  if (again) row(again)?.focus({ preventScroll: true });
  times.renew();
  await choose(wanted || rows()[0]?.dataset.image);
}

$("choose").addEventListener("click", (event) => {
  const name = event.target.closest("button")?.dataset.image;
  if (name !== undefined) choose(name);
});
$("choose").addEventListener("change", (event) => {
  if (event.target.id === "filter") filter = event.target.value;
  else if (event.target.id === "of-camera") camera = event.target.value;
  filtered();
});
for (const name of ["found", "expected", "left"]) $(name).addEventListener("click", () => toggle(name));
$("zoom-in").addEventListener("click", () => picture.zoom(1.5));
$("zoom-out").addEventListener("click", () => picture.zoom(1 / 1.5));
$("fit").addEventListener("click", () => picture.fit());
$("leave-out").addEventListener("click", leaveOut);
$("corner").addEventListener("click", pick);
$("undo").addEventListener("click", undo);
$("next").addEventListener("click", () => go(1));
$("previous").addEventListener("click", () => go(-1));
$("wipe").addEventListener("input", () => { picture.share = $("wipe").value / 100; picture.draw(); });

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("input:not([type=checkbox]), select")) return;
  if (event.key === "Escape" && corner.isOn) { corner.end(true); return; }
  const by = { ArrowUp: -1, ArrowDown: 1, Home: -rows().length, End: rows().length }[event.key];
  if (by && document.activeElement.closest("#images")) { event.preventDefault(); go(by); return; }
  const far = event.shiftKey ? 10 : 1;
  const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
  const onPicture = document.activeElement === $("picture");
  if (steps && onPicture) {
    event.preventDefault();
    if (corner.isOn) corner.step(far * steps[0], far * steps[1]);
    else picture.pan(40 * far * steps[0], 40 * far * steps[1]);
    return;
  }
  if (event.key === "Enter" && onPicture && corner.isOn) { event.preventDefault(); corner.enter(takeCorner); return; }
  if (!$("keys").checked) return;
  const action = LETTERS[event.key.toLowerCase()];
  if (action) { event.preventDefault(); action(); }
});

const times = new Times(choose);
filtered();
choose(rows()[0]?.dataset.image);
if (box.all.length) box.flush();
watch("images", renew, async () => { if (box.all.length && (await box.flush())) say(text.sent); });
