// What all panels share: requests, texts, and word of changes. It asks once a second what has
// changed, by whatever hand; a lost link or a page that was started anew heals by itself.

export const $ = (id) => document.getElementById(id);
export const words = json("words");
export const data = json("data");
export const campaign = document.documentElement.dataset.campaign ?? ""; // its key

function json(id) { return JSON.parse($(id)?.textContent ?? "{}"); }

// A text of the panel with what stands in braces put in.
export function said(text, values = {}) {
  return text.replace(/\{(\w+)\}/g, (all, name) => (name in values ? String(values[name]) : all));
}

// The members of the answer with its status; 0 where the page cannot be reached.
export async function ask(path, body, seconds = 20) {
  const headers = campaign ? { "Gtval-Campaign": campaign } : {};
  const sent = body === undefined ? { headers } : {
    method: "POST", headers: { ...headers, "Content-Type": "application/json" }, body: JSON.stringify(body),
  };
  try {
    const response = await fetch(path, { ...sent, signal: AbortSignal.timeout(seconds * 1000) });
    // A device that has to join again, or another campaign that is served at this address now.
    if ((response.status === 401 && !$("join")) || response.status === 421) location.reload();
    const isJson = response.headers.get("content-type")?.startsWith("application/json");
    const answer = isJson ? await response.json() : { text: await response.text() };
    return { status: response.status, ...answer };
  } catch {
    return { status: 0 };
  }
}

// A part of the page as the server sets it; what was focused and what was open stays so.
export async function replace(id, path) {
  const answer = await ask(path);
  if (answer.status !== 200) return false;
  const part = $(id);
  const focused = part.contains(document.activeElement) ? document.activeElement : null;
  const mark = focused && (focused.id || focused.getAttribute("href"));
  const open = [...part.querySelectorAll("details")].map((one) => one.open);
  part.innerHTML = answer.text;
  part.querySelectorAll("details").forEach((one, at) => { if (at < open.length) one.open = open[at]; });
  if (mark) [...part.querySelectorAll("a, button, [tabindex]")].find((one) => one.id === mark || one.getAttribute("href") === mark)?.focus();
  return true;
}

// Mark the row of a list that is shown. The list is one stop of the Tab key: a list of a thousand
// would stand between the keyboard and all that comes after it; arrows go through it.
export function mark(rows, current) {
  for (const one of rows) {
    one.toggleAttribute("aria-current", false);
    one.tabIndex = -1;
  }
  current?.setAttribute("aria-current", "true");
  const stop = [current, ...rows].find((one) => one && !one.parentElement.hidden);
  if (stop) stop.tabIndex = 0;
}

const watchers = [];
let known = null;

// Call back with the whole answer whenever a panel's version has changed, and of each answer.
export function watch(panel, changed, always = () => {}) { watchers.push({ panel, changed, always }); }

// Whatever a panel stumbles over, the page goes on looking.
async function lookOn() {
  try { await look(); } finally { setTimeout(lookOn, 1000); }
}

async function look() {
  const answer = await ask("/versions", undefined, 8);
  const link = $("page-link");
  const text = answer.status === 200 ? words.frame.connected : words.frame.no_link;
  if (link.textContent !== text) { link.textContent = text; link.className = answer.status === 200 ? "link" : "link down"; }
  if (answer.status === 200) {
    for (const one of answer.panels) count(one);
    const before = known;
    known = Object.fromEntries(answer.panels.map((one) => [one.name, one.version]));
    for (const one of watchers) {
      one.always(answer);
      if (before && before[one.panel] !== known[one.panel]) await one.changed(answer);
    }
  }
}

function count(one) {
  const place = document.querySelector(`.head a[data-name="${one.name}"] .mark`);
  if (!place) return;
  place.hidden = !one.count;
  const [shown, told] = place.children;
  if (shown.textContent === String(one.count)) return;
  shown.textContent = one.count;
  told.textContent = `, ${said(words.frame.waiting, { count: one.count })}`;
}

if ($("page-link")) lookOn();
