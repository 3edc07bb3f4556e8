// The signals of a source over those of a reference, and parts of it that are selected and moved.
// The server finds the delays; nothing is decided here.

import { $, ask, replace, said, watch, words } from "/static/frame.js";
import { Plot } from "./plot.js";

const text = words.panel;
const LETTERS = {
  j: () => go(1), k: () => go(-1), n: () => goPart(1), p: () => goPart(-1), a: () => align(), z: () => plot.toPart(),
  "+": () => plot.zoom(1.5), "=": () => plot.zoom(1.5), "-": () => plot.zoom(1 / 1.5), 0: () => plot.fit(),
};
const ROUND = 1000;

const plot = new Plot($("plot"), dragged, refine);
let source = "", reference = "";
let parts = []; // { first, last, moved, told } of the source that is shown
let chosen = -1;
let whole = null; // the clock of the source as a whole
let asking = false, askNext = false;

const rows = () => [...document.querySelectorAll("#sources button")];
const row = (name) => rows().find((one) => one.dataset.source === name);
const seen = () => rows().filter((one) => !one.parentElement.hidden);
const ms = (seconds) => (1000 * seconds).toFixed(1).replace("-", "−");
const query = (values) => new URLSearchParams({ reference, source, ...values });

function told(answer) {
  const reason = answer.reason || text.no_reason;
  if (answer.delay === null || answer.low === null) return said(text.delay_not_determinable, { reason });
  const numbers = { delay: ms(answer.delay), low: ms(answer.low), high: ms(answer.high), confidence: Math.round(100 * answer.confidence), reason };
  return said(text[`delay_${answer.verdict}`], numbers);
}

async function choose(name) {
  if (!name) { $("source-title").textContent = text.choose; return; }
  source = name;
  const [mine, theirs] = [source, reference];
  const isOld = () => mine !== source || theirs !== reference;
  for (const one of rows()) one.removeAttribute("aria-current");
  row(name)?.setAttribute("aria-current", "true");
  row(name)?.scrollIntoView({ block: "nearest" });
  $("source-title").textContent = said(text.title_of, { source, reference });
  $("legend-source").textContent = said(text.legend_source, { name: source });
  $("legend-reference").textContent = said(text.legend_reference, { name: reference });
  $("whole").textContent = text.working;
  $("part-told").textContent = "";
  parts = [];
  chosen = -1;
  whole = null;
  plot.part = null;
  plot.delay = 0;
  const signals = await ask(`/trajectories/signals?${query({})}`, undefined, 130);
  if (isOld()) return;
  if (signals.status !== 200) { $("whole").textContent = signals.error ?? words.frame.no_server; plot.signals = null; plot.draw(); showParts(); return; }
  plot.show(signals);
  parts = signals.parts.map(([first, last]) => ({ first, last, moved: 0, told: "" }));
  if (!parts.length) parts = [own(signals)];
  choosePart(0, false);
  const clock = await ask(`/trajectories/clock?${query({})}`, undefined, 130);
  if (isOld()) return;
  whole = clock.status === 200 ? clock : null;
  const content = whole ? told(whole) : clock.error ?? words.frame.no_server;
  $("whole").textContent = `${text.whole}: ${content}`;
  if (row(name)) row(name).querySelector(".first").textContent = content;
  place();
  if (whole?.delay !== null && whole && parts[chosen]) for (const one of parts) one.moved = one.moved || whole.delay;
  if (parts[chosen]) { plot.part = { ...parts[chosen] }; numbers(); }
  for (const one of parts) {
    if (isOld()) return;
    await find(one);
  }
}

// A part of one's own, where none is proposed: the middle of the source.
function own(signals) {
  const [a, b] = signals.own_span, long = Math.min(b - a, 20);
  return { first: (a + b - long) / 2, last: (a + b + long) / 2, moved: 0, told: "", isOwn: true };
}

function place() {
  const isAligned = $("aligned").getAttribute("aria-pressed") === "true";
  plot.delay = isAligned && whole?.delay ? whole.delay : 0;
  plot.draw();
}

function align() {
  $("aligned").setAttribute("aria-pressed", $("aligned").getAttribute("aria-pressed") !== "true");
  place();
}

// -- parts ----------------------------------------------------------------------------------

function showParts() {
  const focused = $("parts").contains(document.activeElement) ? [...$("parts").children].indexOf(document.activeElement) : -1;
  $("parts").replaceChildren(...parts.map((one, at) => {
    const button = document.createElement("button");
    const name = one.isOwn ? text.part_own : said(text.part, { number: at + 1 });
    button.type = "button";
    button.setAttribute("aria-pressed", at === chosen);
    button.textContent = one.told ? `${name}: ${one.told}` : name;
    button.addEventListener("click", () => choosePart(at, true));
    return button;
  }));
  $("parts").children[focused]?.focus();
}

function choosePart(at, look) {
  chosen = at;
  plot.part = parts[at] ? { ...parts[at] } : null;
  numbers();
  showParts();
  tellPart();
  if (look) plot.toPart();
  else plot.draw();
}

function goPart(by) { if (parts.length) choosePart((chosen + by + parts.length) % parts.length, true); }

function numbers() {
  const { part } = plot;
  for (const name of ["first", "last", "moved"]) {
    $(name).disabled = !part;
    $(name).value = part ? Math.round(part[name] * ROUND) / ROUND : "";
  }
}

function tellPart() {
  const one = parts[chosen];
  $("part-told").textContent = one?.told ? `${one.told}${one.found ? ` – ${one.found}` : ""}` : "";
  const { part } = plot;
  const values = part ? Object.fromEntries(["first", "last", "moved"].map((name) => [name, part[name].toFixed(2)])) : {};
  $("plot").setAttribute("aria-label", said(text.plot_told, {
    signal: text[plot.signal], reference, source, from: plot.view[0].toFixed(1), to: plot.view[1].toFixed(1), part: part ? said(text.plot_part, values) : "",
  }));
}

// A part that is dragged; where it rests its delay is found, the newest place last.
function dragged(part, rests) {
  if (!parts[chosen]) return;
  Object.assign(parts[chosen], { first: part.first, last: part.last, moved: part.moved });
  numbers();
  if (rests) find(parts[chosen]);
}

async function find(one) {
  if (asking) { askNext = one; return; }
  asking = true;
  askNext = null;
  if (one === parts[chosen]) $("part-told").textContent = text.working;
  const { first, last, moved } = one;
  const answer = await ask("/trajectories/part", { reference, source, from: first, to: last, moved }, 130);
  asking = false;
  if (parts.includes(one)) {
    if (answer.status === 200) {
      one.told = told(answer);
      one.found = said(text.found_in, answer);
      const rests = one.first === first && one.last === last && one.moved === moved && !plot.pointers.size;
      if (answer.delay !== null && rests) {
        one.moved = answer.delay;
        if (one === parts[chosen]) { plot.part = { ...one }; plot.draw(); numbers(); }
      }
    } else { one.told = answer.error ?? words.frame.no_server; one.found = ""; }
    showParts();
    if (one === parts[chosen]) tellPart();
  }
  if (askNext) await find(askNext);
}

function typed() {
  const one = parts[chosen];
  if (!one) return;
  const values = Object.fromEntries(["first", "last", "moved"].map((name) => [name, Number($(name).value)]));
  if (Object.values(values).some((value) => !Number.isFinite(value)) || values.first >= values.last) return;
  Object.assign(one, values);
  plot.part = { ...one };
  plot.draw();
  clearTimeout(typed.resting);
  typed.resting = setTimeout(() => find(one), 250);
}

function step(seconds) {
  if (!parts[chosen]) return;
  $("moved").value = Math.round((parts[chosen].moved + seconds) * ROUND) / ROUND;
  typed();
}

// -- the list -------------------------------------------------------------------------------

// Points of a closer view, with the ones that a wide one leaves out.
async function refine([first, last]) {
  if (!plot.signals) return;
  const [mine, theirs] = [source, reference], rim = (last - first) / 4 + 3;
  const answer = await ask(`/trajectories/signals?${query({ from: first - rim, to: last + rim })}`, undefined, 130);
  if (answer.status !== 200 || mine !== source || theirs !== reference || plot.view[0] !== first || plot.view[1] !== last) return;
  plot.signals = answer;
  plot.draw();
  tellPart();
}

function go(by) {
  const shown = seen(), at = shown.indexOf(row(source));
  const next = shown[Math.min(Math.max(at + by, 0), shown.length - 1)];
  if (!next) return;
  if (document.activeElement?.closest("#sources")) next.focus();
  choose(next.dataset.source);
}

function filtered() {
  if (!$("reference")) return;
  if ([...$("reference").options].some((one) => one.value === reference)) $("reference").value = reference;
  else reference = $("reference").value;
  for (const one of rows()) one.parentElement.hidden = one.dataset.source === reference;
}

async function renew() {
  if (!(await replace("choose", "/trajectories/list"))) return;
  filtered();
  const again = row(source) && source !== reference ? source : seen()[0]?.dataset.source;
  await choose(again);
}

function show(signal) {
  plot.signal = signal;
  plot.unit = text[`unit_${signal}`];
  for (const one of document.querySelectorAll("[data-signal]")) one.setAttribute("aria-pressed", one.dataset.signal === signal);
  plot.draw();
  tellPart();
}

$("choose").addEventListener("click", (event) => {
  const name = event.target.closest("button")?.dataset.source;
  if (name) choose(name);
});
$("choose").addEventListener("change", (event) => {
  if (event.target.id !== "reference") return;
  reference = event.target.value;
  for (const one of rows()) one.querySelector(".first").textContent = "";
  filtered();
  choose(source === reference ? seen()[0]?.dataset.source : source);
});
for (const one of document.querySelectorAll("[data-signal]")) one.addEventListener("click", () => show(one.dataset.signal));
$("aligned").addEventListener("click", align);
$("to-part").addEventListener("click", () => plot.toPart());
$("zoom-in").addEventListener("click", () => plot.zoom(1.5));
$("zoom-out").addEventListener("click", () => plot.zoom(1 / 1.5));
$("fit").addEventListener("click", () => plot.fit());
$("reset").addEventListener("click", () => {
  if (!parts[chosen]) return;
  parts[chosen].moved = 0; // only shown so: what was found stays said
  choosePart(chosen, false);
});
for (const name of ["first", "last", "moved"]) $(name).addEventListener("input", typed);

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("input:not([type=checkbox]), select")) return;
  const way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (way && document.activeElement === $("plot")) {
    event.preventDefault();
    if (event.shiftKey) step(0.02 * way);
    else plot.pan(0.1 * way);
    return;
  }
  if (!$("keys").checked) return;
  const action = LETTERS[event.key.toLowerCase()];
  if (action) { event.preventDefault(); action(); }
});

reference = $("reference")?.value ?? "";
show("heading");
filtered();
choose(seen()[0]?.dataset.source);
watch("trajectories", renew);
