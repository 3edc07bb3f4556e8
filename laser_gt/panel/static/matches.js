// The pairs of stops, one large, and what is decided about them. The server says what a match is
// worth; here it is shown, moved, and decided on.

import { $, ask, mark, replace, said, watch, words } from "/static/frame.js";
import { Outbox } from "/static/outbox.js";
import { Scans } from "./scans.js";

const text = words.panel;
const LETTERS = { j: () => go(1), k: () => go(-1), a: () => decide("accept"), r: () => decide("reject"), m: () => move(true), u: () => undo(), b: () => toggleWhen(), c: () => toggle("contradictions"), "+": () => scans.zoom(1.5), "=": () => scans.zoom(1.5), "-": () => scans.zoom(1 / 1.5), 0: () => scans.fit() };

const scans = new Scans($("scans"), moved);
let pair = null; // what the server said of the pair that is shown
let wanted = 0; // the number of the pair asked for last
let chosen = ""; // its name, which outlives the list
let before = null; // the match as it was before the scan was moved
let trial = null; // the guess that was tried last
let trying = false, tryNext = null;

scans.bar = (step, pixels) => {
  $("scale-bar").style.width = `${pixels}px`;
  $("scale-text").textContent = step >= 1 ? `${step} m` : `${step * 100} cm`;
};

const rows = () => [...document.querySelectorAll("#pairs button")];
const seen = () => rows().filter((row) => !row.parentElement.hidden);
const key = (row) => JSON.stringify([row.dataset.reference, row.dataset.moving]);
const keyOf = (match) => JSON.stringify([match.reference, match.moving]);
const row = (name) => rows().find((one) => key(one) === name);
const nameOf = (match) => `${match.reference} – ${match.moving}`;
const kindOf = (verdict) => verdict.replaceAll(" ", "_");
const percent = (value) => `${Math.round(100 * (value ?? 0))} %`;

function item(list, content, className) {
  const one = document.createElement("li");
  one.textContent = content;
  if (className) one.className = className;
  list.append(one);
}

function say(content, bad = false) {
  $("said").textContent = content;
  $("said").className = bad ? "bad" : "";
}

async function choose(button, focus = false) {
  if (!button) return;
  wanted += 1;
  chosen = key(button);
  const asked = wanted;
  mark(rows(), button);
  button.scrollIntoView({ block: "nearest" });
  const { reference, moving } = button.dataset;
  const answer = await ask(`/matches/pair?${new URLSearchParams({ reference, moving })}`);
  if (asked !== wanted) return; // another one was chosen meanwhile
  if (answer.status !== 200) { if (!box.all.length) say(answer.error ?? words.frame.no_server, true); return; }
  const same = pair && keyOf(pair.match) === keyOf(answer.match);
  if (!$("moving").hidden) { if (same) return; leave(); }
  pair = answer;
  const view = [scans.centre, scans.scale];
  scans.show(pair);
  if (same) { [scans.centre, scans.scale] = view; scans.draw(); }
  if ($("when").getAttribute("aria-pressed") === "true") showWhen();
  tell();
  if (focus) button.focus();
}

function tell() {
  const { match } = pair;
  $("pair-title").textContent = said(text.verdict_of, { reference: match.reference, moving: match.moving, verdict: match.verdict });
  $("legend-reference").textContent = said(text.legend_reference, match);
  $("legend-moving").textContent = said(text.legend_moving, match);
  $("decision").hidden = !pair.decision;
  $("decision").textContent = pair.decision ? said(pair.decision.by ? text.decision_by : text.decision, pair.decision) : "";
  $("reasons").replaceChildren();
  for (const one of match.reasons) item($("reasons"), one.text, one.objection ? "objection" : "");
  if (!match.reasons.length) item($("reasons"), text.no_reasons);
  $("loops").replaceChildren();
  for (const one of pair.loops) item($("loops"), said(one.closes ? text.loop_closes : text.loop_open, one), one.closes ? "closes" : "open");
  if (!pair.loops.length) item($("loops"), text.no_loops);
  const { facts, pose } = match;
  $("facts").textContent = said(text.facts, {
    x: pose[0].toFixed(3), y: pose[1].toFixed(3), theta: (pose[2] * 180 / Math.PI).toFixed(2),
    length: (1e3 * facts.sigma_length).toFixed(1), angle: (1e3 * facts.sigma_angle).toFixed(1),
    explained: percent(facts.explained), agreement: percent(facts.agreement), violating: percent(facts.violating), returned: percent(facts.returned),
  });
  describe();
}

function describe() {
  const isBefore = $("when").getAttribute("aria-pressed") === "true";
  const shown = scans.match ?? pair.match;
  $("scans").setAttribute("aria-label", said(text.picture_told, {
    reference: pair.match.reference, moving: pair.match.moving, when: isBefore ? text.before : text.after,
    verdict: text[`is_${kindOf(pair.match.verdict)}`], contradicting: shown.contradicting[0].length + shown.contradicting[1].length,
  }));
}

function go(by) {
  const shown = seen();
  const at = shown.findIndex((one) => one.hasAttribute("aria-current"));
  choose(shown[Math.min(Math.max(at + by, 0), shown.length - 1)], document.activeElement?.closest("#pairs") !== null);
}

function toggle(name) {
  const on = $(name).getAttribute("aria-pressed") !== "true";
  $(name).setAttribute("aria-pressed", on);
  scans.shown[name] = on;
  if ($(`legend-${name}`)) $(`legend-${name}`).hidden = !on;
  scans.draw();
}

function toggleWhen() {
  $("when").setAttribute("aria-pressed", $("when").getAttribute("aria-pressed") !== "true");
  showWhen();
}

function showWhen() {
  if (!pair) return;
  const isBefore = $("when").getAttribute("aria-pressed") === "true";
  scans.pose = [...(isBefore ? pair.guess : pair.match.pose)];
  scans.match = isBefore ? { ...pair.match, residuals: null, contradicting: [[], []] } : pair.match;
  scans.draw();
  describe();
}

// -- decisions ------------------------------------------------------------------------------

const box = new Outbox("matches", "/matches/decide", nameOf, (problem) => say(problem, true));

async function decide(decision, guess = null) {
  if (!pair) { say(text.not_shown, true); return; }
  const { match } = pair;
  if (keyOf(match) !== chosen) { say(text.not_shown, true); return; } // what nobody has seen
  if (!$("moving").hidden) { say(text.is_moved, true); return; }
  const more = guess ? { x: guess[0], y: guess[1], theta: guess[2] } : {};
  const sent = box.add({ reference: match.reference, moving: match.moving, decision, ...more });
  const button = row(keyOf(match));
  const shown = seen();
  const next = shown[shown.indexOf(button) + 1];
  if (await sent) say(said(text[`recorded_${decision}`], { pair: nameOf(match) }));
  button?.parentElement.setAttribute("data-decided", "");
  if (next) choose(next, document.activeElement?.closest("#pairs") !== null);
}

async function undo() {
  if (!(await box.flush())) return;
  const answer = await ask("/matches/undo", {});
  if (answer.status !== 200) { say(answer.error ?? words.frame.no_server, true); return; }
  say(said(text.undone, { pairs: answer.pairs.map((one) => one.join(" – ")).join(", ") }));
  const [first] = answer.pairs;
  if (first) choose(row(JSON.stringify(first)));
}

// -- the scan moved by hand -----------------------------------------------------------------

function move(on) {
  if (!pair || !on || !$("moving").hidden) return;
  if ($("when").getAttribute("aria-pressed") === "true") toggleWhen();
  before = pair.match;
  trial = null;
  scans.isMoving = true;
  $("moving").hidden = false;
  $("decide").hidden = true;
  $("tried").textContent = narrow.matches ? text.move_by_touch : "";
  $("tried").className = "";
  $("take-guess").disabled = true;
  $("scans").focus({ preventScroll: true });
  if (narrow.matches) $("pair-title").scrollIntoView(); // the picture, and below it what is to be done
}

function leave() {
  scans.isMoving = false;
  $("moving").hidden = true;
  $("decide").hidden = false;
  scans.match = pair.match;
  scans.pose = [...pair.match.pose];
  scans.draw();
}

// While it is dragged nothing is asked; where it rests, it is matched, the newest place last.
function moved(pose, rests) {
  $("take-guess").disabled = true;
  if (rests) { tryNext = [...pose]; tryIt(); }
}

async function tryIt() {
  if (trying || !tryNext) return;
  trying = true;
  const guess = tryNext;
  tryNext = null;
  const of = keyOf(pair.match);
  $("tried").textContent = text.trying;
  const { reference, moving } = pair.match;
  const answer = await ask("/matches/try", { reference, moving, x: guess[0], y: guess[1], theta: guess[2] });
  trying = false;
  if (tryNext) { tryIt(); return; }
  if ($("moving").hidden || of !== keyOf(pair.match)) return;
  $("tried").className = answer.status === 200 ? "" : "bad";
  if (answer.status !== 200) { $("tried").textContent = answer.error ?? words.frame.no_server; return; }
  trial = guess;
  if (!scans.pointers.size) { scans.match = answer.match; scans.pose = [...answer.match.pose]; scans.draw(); }
  const objections = answer.match.reasons.filter((one) => one.objection).map((one) => one.text).join("; ");
  $("tried").textContent = said(text.tried, { verdict: text[`is_${kindOf(answer.match.verdict)}`], milliseconds: answer.milliseconds }) + (objections ? ` ${objections[0].toUpperCase()}${objections.slice(1)}.` : "");
  $("take-guess").disabled = false;
}

async function takeGuess() {
  if (!trial) return;
  const guess = trial;
  leave();
  $("move").focus();
  await decide("guess", guess);
}

// -- many at once ---------------------------------------------------------------------------

let batch = { kind: "", pairs: [] }; // what was looked at

async function lookAtBatch(button) {
  batch = { kind: button.dataset.kind, pairs: [] };
  $("batch-title").textContent = button.getAttribute("aria-label");
  $("batch-text").textContent = text.trying;
  $("batch-accept").disabled = true;
  $("batch").showModal();
  const answer = await ask("/matches/batch", { kind: batch.kind, look: true }, 60);
  if (answer.status !== 200) { $("batch-text").textContent = answer.error ?? words.frame.no_server; return; }
  const { count, pairs, more, placed } = answer;
  batch.pairs = pairs;
  const places = more.length ? said(text.batch_places, { more: more.length, names: more.join(", ") }) : said(text.batch_places_none, { placed });
  $("batch-text").textContent = `${said(text.batch_would, { count })} ${places}`;
  $("batch-accept").disabled = false;
  $("batch-accept").focus();
}

async function acceptBatch() {
  const answer = await ask("/matches/batch", batch, 60);
  if (answer.status === 200) { $("batch").close(); say(said(text.batch_done, { count: answer.recorded })); }
  else $("batch-text").textContent = answer.error ?? words.frame.no_server;
}

// -- the list -------------------------------------------------------------------------------

let filter = "all", folded = false;
const narrow = matchMedia("(max-width: 60rem)");

function filtered() {
  if (narrow.matches && $("batches") && !folded) { $("batches").open = false; folded = true; } // the pair comes first
  const select = $("filter");
  if (!select) return;
  select.value = filter;
  let any = false;
  for (const one of document.querySelectorAll("#pairs li")) {
    one.hidden = !(filter === "all" || (filter === "decided" ? one.hasAttribute("data-decided") : one.dataset.verdict === filter));
    any ||= !one.hidden;
  }
  $("none").hidden = any;
  $("none").textContent = said(text.none_in_list, { name: select.selectedOptions[0]?.textContent ?? "" });
  mark(rows(), row(chosen));
}

async function renew() {
  const scrolled = [$("choose").scrollTop, $("pairs")?.scrollTop ?? 0];
  const focused = document.activeElement?.closest("#pairs button");
  const again = focused && key(focused);
  if (!(await replace("choose", "/matches/list"))) return;
  filtered();
  $("choose").scrollTop = scrolled[0];
  if ($("pairs")) $("pairs").scrollTop = scrolled[1];
  const button = row(chosen) ?? rows()[0]; // chosen while the list was asked for, too
  if (again) row(again)?.focus({ preventScroll: true });
  if (button) await choose(button);
}

$("choose").addEventListener("click", (event) => {
  const button = event.target.closest("button");
  if (button?.dataset.kind) lookAtBatch(button);
  else if (button?.dataset.reference !== undefined) choose(button);
});
$("choose").addEventListener("change", (event) => {
  if (event.target.id !== "filter") return;
  filter = event.target.value;
  filtered();
});
for (const name of ["residuals", "contradictions", "normals"]) $(name).addEventListener("click", () => toggle(name));
$("when").addEventListener("click", toggleWhen);
$("zoom-in").addEventListener("click", () => scans.zoom(1.5));
$("zoom-out").addEventListener("click", () => scans.zoom(1 / 1.5));
$("fit").addEventListener("click", () => scans.fit());
$("accept").addEventListener("click", () => decide("accept"));
$("reject").addEventListener("click", () => decide("reject"));
$("move").addEventListener("click", () => move(true));
$("undo").addEventListener("click", undo);
$("next").addEventListener("click", () => go(1));
$("previous").addEventListener("click", () => go(-1));
$("take-guess").addEventListener("click", takeGuess);
$("leave-move").addEventListener("click", () => { leave(); $("move").focus(); });
$("batch-accept").addEventListener("click", acceptBatch);
$("batch-cancel").addEventListener("click", () => $("batch").close());
$("moving").addEventListener("click", (event) => {
  const step = event.target.closest("[data-step]")?.dataset.step;
  if (step) scans.step(step.split(",").map(Number));
});

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("input:not([type=checkbox]), select, dialog[open]")) return;
  if (event.key === "Escape" && !$("moving").hidden) { leave(); $("move").focus(); return; }
  const by = { ArrowUp: -1, ArrowDown: 1, Home: -rows().length, End: rows().length }[event.key];
  if (by && document.activeElement.closest("#pairs")) { event.preventDefault(); go(by); return; }
  const far = event.shiftKey ? 10 : 1;
  const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
  if (steps && document.activeElement === $("scans")) {
    event.preventDefault();
    if (scans.isMoving) scans.step([0.02 * far * steps[0], 0.02 * far * steps[1], 0]);
    else scans.pan(40 * far * steps[0], 40 * far * steps[1]);
    return;
  }
  if (!$("keys").checked) return;
  if (scans.isMoving && (event.key === "," || event.key === ".")) { scans.step([0, 0, event.key === "," ? 1 : -1]); return; }
  const action = LETTERS[event.key.toLowerCase()];
  if (action) { event.preventDefault(); action(); }
});

filtered();
if (rows().length) choose(rows()[0]);
if (box.all.length) box.flush();
watch("matches", renew, async () => { if (box.all.length && (await box.flush())) say(text.sent); });
