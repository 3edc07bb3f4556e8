// The page at the laser. It shows what the laptop says; while the link is down it goes on along
// the targets that it was given, and the readings wait in the queue.

import { Queue, newId, post } from "./queue.js";
import { stayAwake } from "./awake.js";
import { connectMeter, whyNoMeter } from "./meter.js";
import { drawMap } from "./room_map.js";
import { allowSound, confirmBySound } from "./sound.js";

const $ = (id) => document.getElementById(id);
const FEET = /^\d[\d.,\s/-]*(?:['"′″]|ft|in|cm)[\d\s./"′″ftin-]*$/i; // the laptop reads these
const NUMBER = /^(?:\d{1,9}(?:[.,]\d{1,9})?|[.,]\d{1,9})\s*(?:mm|m)?$/i;

if ($("join")) join(); else work();

function join() {
  const message = $("message");
  if (location.hash.length > 1) {
    $("code").value = decodeURIComponent(location.hash.slice(1));
    history.replaceState(null, "", "/"); // the code is nobody else's business
    $("name").focus();
  } else $("code").focus();
  $("join").addEventListener("submit", async (event) => {
    event.preventDefault();
    const answer = await post("/join", { code: $("code").value, name: $("name").value });
    if (answer.status === 200) location.replace("/");
    else message.textContent = answer.error ?? "The laptop cannot be reached.";
  });
}

function work() {
  let state = JSON.parse($("state").textContent);
  let targets = []; // those not yet typed here, the next one first
  let again = null; // a reading to measure once more, by the person's wish
  let last = state.last; // the reading that Again and Keep are about
  let standing = ""; // where the laser stood for the reading typed last here
  let submissions = 0;
  let typedLast = null; // value and pair of the last number, to ask of one that came twice
  let meant = false; // whether the page is left by its own wish
  const queue = new Queue(state.key);

  // What waits here for the link is done as far as this device is concerned.
  function takeTargets() {
    const waiting = queue.waiting();
    targets = state.targets.filter((one) => !waiting.some((w) => w.from === one.from && w.to === one.to));
  }

  function current() { return again ?? targets[0] ?? null; }

  function show() {
    const target = current();
    $("from").textContent = target?.from ?? "–";
    const open = state.doubtful.length + state.disagreeing.length;
    $("to").textContent = target?.to ?? (open ? `${open} doubtful` : state.unexamined ? "looking…" : "all done");
    $("warnings").hidden = !state.warnings.length;
    $("warnings-text").textContent = state.warnings.join(" ");
    $("take").hidden = $("aside").hidden = !state.edited;
    $("unchecked").textContent = state.unchecked;
    $("why-again").hidden = !target?.again || target === again;
    $("move").hidden = !target || !standing || standing === target.from;
    $("move").textContent = target ? `Move the laser to ${target.from}.` : "";
    $("progress").textContent = state.progress;
    $("who").textContent = state.by || "nobody named";
    $("status").textContent = state.behind || state.status.text;
    $("enough").hidden = !state.status.enough;
    $("enough-text").textContent = state.status.enough && `${state.status.enough}.`;
    $("next-stop").hidden = !state.status.next;
    $("next-stop").textContent = `Go on with stop ${state.status.next}`;
    drawMap($("map"), $("map-caption"), state.map, target);
    showLists();
  }

  function showLists() {
    $("station-title").textContent = `Station ${state.station.name}: ${state.station.progress}`;
    list("station", state.station.rows, (row) => [[`${row.from}–${row.to}`, row.value, row.state], stationButton(row)]);
    list("recent", state.recent, (row) => [[row.pair, row.value, [row.by, row.fate, ...row.notes].filter(Boolean).join(", ")]]);
    const unexamined = state.unexamined ? " (still looking)" : "";
    const doubtful = [...state.doubtful, ...state.disagreeing];
    $("doubtful-title").textContent = `Doubtful: ${doubtful.length}${unexamined}`;
    list("doubtful", doubtful, (row) => row.number ? [
      [row.text, ""],
      button("Again", `Measure ${row.text} again`, () => measureAgain(row)),
      button("Keep", `Keep ${row.text}`, () => act({ action: "keep", number: row.number })),
    ] : [
      [`${row.text}: two entries disagree`, ""],
      button("Go", `Measure ${row.text} again`, () => act({ action: "jump", text: `${row.from} ${row.to}` })),
    ]);
    const refused = queue.refused();
    $("refused-box").hidden = !refused.length;
    $("refused-title").textContent = `Not taken: ${refused.length}`;
    list("refused", refused, (row) => [
      [`${row.from}–${row.to} ${row.text}: ${row.error}`, ""],
      button("Forget", `Forget ${row.text}`, () => { queue.dismiss(row.id); show(); }),
    ]);
  }

  function stationButton(row) {
    const pair = `${row.from}–${row.to}`;
    if (row.state === "done" || row.state === "doubtful") return button("Again", `Measure ${pair} again`, () => measureAgain(row));
    return button("Go", `Go on with ${pair}`, () => act({ action: "jump", text: `${row.from} ${row.to}` }));
  }

  function measureAgain(pair) {
    again = { from: pair.from, to: pair.to, again: true };
    show();
    $("distance").focus();
  }

  function list(id, rows, cells) {
    $(id).replaceChildren(...rows.map((row) => {
      const item = document.createElement("li");
      if (row.state) item.className = row.state;
      const [texts, ...buttons] = cells(row);
      texts.forEach((text, at) => {
        const span = document.createElement("span");
        if (at === 2) span.className = "state";
        span.textContent = text;
        item.append(span);
      });
      item.append(...buttons);
      return item;
    }));
  }

  function button(text, label, action) {
    const made = document.createElement("button");
    made.type = "button";
    made.textContent = text;
    made.setAttribute("aria-label", label);
    made.addEventListener("click", action);
    return made;
  }

  function say(kind, lines, spoken = "", aloud = true) {
    const box = $("answer");
    const as = [...box.children].map((child) => child.textContent);
    if (kind === "look" && box.className === kind && as.join() === lines.join() && !spoken) return;
    box.className = kind;
    box.replaceChildren(...lines.map((line) => {
      const paragraph = document.createElement("p");
      paragraph.textContent = line;
      return paragraph;
    }));
    if (aloud) confirmBySound(kind, spoken);
  }

  function showLink(up) {
    const waiting = queue.waiting().length;
    const link = $("link");
    const text = up ? (waiting ? `sending ${waiting}` : "connected") : `no link, ${waiting} waiting`;
    if (link.textContent !== text) link.textContent = text;
    link.className = up ? "" : "down";
  }

  function submit(event) {
    event.preventDefault();
    const field = $("distance");
    const text = field.value.trim();
    const target = current();
    if (!text) return;
    if (!target) { say("look", ["Everything is done. Choose where to go on under “More”."]); return; }
    if (!NUMBER.test(text) && !FEET.test(text)) {
      say("look", [`“${text}” is not a distance; expected a number such as 5.378 or 5378.`]);
      field.select();
      return;
    }
    const repeated = typedLast?.text === text && !target.again && !isPair(typedLast, target);
    const sure = typedLast?.asked === true && typedLast.text === text && isPair(typedLast, target);
    typedLast = { text, from: target.from, to: target.to, asked: repeated };
    if (repeated) {
      say("look", ["The same value as just before: was it sent twice, or not measured anew? If the display shows it, enter it once more."]);
      field.select();
      return;
    }
    submissions += 1;
    queue.add({
      id: newId(), from: target.from, to: target.to, text, again: Boolean(target.again),
      by: state.by, second: state.second, sure, typed: Date.now(),
    });
    standing = target.from;
    if (target === again) again = null; else targets = targets.slice(1);
    field.value = "";
    say("waiting", [`${target.from}–${target.to}: ${text} …`]);
    show();
    deliver();
  }

  function isPair(one, other) { return one.from === other.from && one.to === other.to; }

  // A meter's length goes the way of a typed one.
  function measured(metres) {
    $("distance").value = metres.toFixed(state.decimals);
    $("entry").requestSubmit();
  }

  async function deliver() {
    const up = await queue.send(told);
    showLink(up);
    const waiting = queue.waiting();
    if (!up && waiting.length) sayWaiting(waiting.at(-1));
    if (up && !queue.waiting().length) await refresh(true);
  }

  // Said in place of the dots, once; the sound was made when it was typed.
  function sayWaiting(reading) {
    const kept = queue.isUnsafe ? "kept on this page: do NOT close it" : "kept on this device";
    const text = `${reading.from}–${reading.to}: ${reading.text} is ${kept} until the link is back. Go on, and do not reload.`;
    if ($("answer").className === "waiting" && $("answer").textContent !== text) say("waiting", [text], "", false);
  }

  function told(reading, answer) {
    if (answer.status === 401) { joinAnew(); return; }
    if (answer.status !== 200) { say("look", [answer.error ?? "not taken"]); return; }
    if (answer.outcome !== "refused") last = { number: answer.number, from: reading.from, to: reading.to };
    say(answer.look ? "look" : "ok", answer.lines, reading.text);
  }

  // The laptop was started anew and knows this device no more: it asks for the code once more.
  // What waits lies in the browser meanwhile.
  function joinAnew() {
    if (queue.isUnsafe) say("look", ["This device was not let in. Open this address once more in a further page and type the code there; leave this one open."]);
    else reload();
  }

  // By the page's own wish: the laptop is there, and nothing needs to be asked.
  function reload() {
    meant = true;
    location.reload();
  }

  // What the laptop has is taken over only if nothing was typed here since it was asked for, and
  // nothing waits: then it knows all. An older answer would bring back a target that is done.
  async function refresh(always = false) {
    const asked = submissions;
    try {
      const version = always ? "" : state.version;
      const response = await fetch(`state?version=${version}`, { signal: AbortSignal.timeout(5000) });
      const fresh = response.status === 200 ? await response.json() : null;
      if (fresh && asked === submissions && !queue.waiting().length && fresh.version >= state.version) {
        state = fresh;
        last = state.last;
        takeTargets();
        show();
      }
      if (response.status === 401) joinAnew();
      showLink(true);
      return true;
    } catch {
      showLink(false);
      return false;
    }
  }

  async function act(said) {
    const answer = await post("actions", said);
    if (answer.status === 200) say("ok", [answer.text]);
    else say("look", [answer.error ?? "The laptop cannot be reached; this needs the link."]);
    again = null;
    await refresh(true);
    $("distance").focus();
  }

  function needLast(then) {
    if (last) then(last);
    else say("look", ["No reading was entered here yet."]);
  }

  $("entry").addEventListener("submit", submit);
  $("undo").addEventListener("click", () => { last = null; act({ action: "undo" }); });
  $("keep").addEventListener("click", () => needLast((one) => act({ action: "keep", number: one.number })));
  $("again").addEventListener("click", () => needLast(measureAgain));
  $("skip").addEventListener("click", () => {
    const target = current();
    if (!target) return;
    $("skip-what").textContent = `${target.from}–${target.to}`;
    $("reason").value = "";
    $("skip-dialog").showModal();
  });
  $("skip-dialog").addEventListener("close", () => {
    const target = current();
    if ($("skip-dialog").returnValue === "skip") act({ action: "skip", from: target.from, to: target.to, text: $("reason").value });
    $("skip-dialog").returnValue = "";
  });
  $("next-stop").addEventListener("click", () => act({ action: "jump", text: state.status.next }));
  form("jump-form", "jump", (text) => act({ action: "jump", text }));
  form("stop-form", "stop", (text) => act({ action: "stop", text }));
  form("mark-form", "mark", (text) => act({ action: "mark", text }));
  $("take").addEventListener("click", () => act({ action: "take" }));
  $("aside").addEventListener("click", () => act({ action: "aside" }));
  $("meter").hidden = Boolean(whyNoMeter());
  $("meter-text").textContent = whyNoMeter();
  $("meter").addEventListener("click", () => connectMeter(measured, (text) => { $("meter-text").textContent = text; }));
  stayAwake((text) => { $("awake").textContent = text; });
  form("note-form", "note", (text) => needLast((one) => act({ action: "note", number: one.number, text })));
  form("person-form", "person", setPerson, false);
  $("second")?.addEventListener("change", () => setPerson($("person").value.trim()));

  function form(id, field, action, empty = true) {
    $(id).addEventListener("submit", (event) => {
      event.preventDefault();
      const text = $(field).value.trim();
      if (text || !empty) action(text);
      if (empty) $(field).value = "";
    });
  }

  async function setPerson(name) {
    const answer = await post("person", { name, second: Boolean($("second")?.checked) });
    say(answer.status === 200 ? "ok" : "look", [answer.error ?? (answer.status ? `At the laser: ${name || "nobody named"}` : "The laptop cannot be reached; this needs the link.")]);
    await refresh(true);
  }

  // A distance meter types like a keyboard: its digits go to the field wherever the focus is.
  document.addEventListener("keydown", (event) => {
    const typing = event.target.closest?.("input, dialog");
    if (!typing && /^[\d.,]$/.test(event.key) && !event.ctrlKey && !event.metaKey && !event.altKey) $("distance").focus();
  });

  // Without the link there is no page to come back to, though what waits would not be lost. The
  // browser asks first; most do so only after something was typed, which is when it matters.
  window.addEventListener("beforeunload", (event) => {
    if (!meant && ($("link").className === "down" || queue.isUnsafe)) event.preventDefault();
  });
  window.addEventListener("hashchange", reload); // a new code for this very page

  if (!document.activeElement?.closest("input, dialog")) $("distance").focus();
  allowSound();
  takeTargets();
  show();
  showLink(true);
  if (queue.waiting().length) deliver();
  setInterval(async () => {
    if (queue.waiting().length) await deliver(); else await refresh();
  }, 1000);
}
