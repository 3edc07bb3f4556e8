// Readings that wait for the link. They lie in the browser's storage, so that neither a lost link
// nor a reload nor a closed page takes one away; each has an id, so that the laptop records it
// once however often it is sent. Each has an entry of its own there: two pages of one browser
// cannot overwrite one another's.

export class Queue {
  constructor(name) {
    this.waitingPrefix = `gtval:${name}:waiting:`;
    this.refusedPrefix = `gtval:${name}:refused:`;
    this.sending = false;
    this.typed = 0;
    this.unsafe = new Map(); // what the browser would not store: kept as long as the page is open
  }

  get isUnsafe() { return this.unsafe.size > 0; }

  waiting() { return this.read(this.waitingPrefix); }

  refused() { return this.read(this.refusedPrefix); }

  add(reading) {
    this.typed += 1;
    const order = `${String(reading.typed).padStart(15, "0")}-${String(this.typed).padStart(6, "0")}`;
    this.write(`${this.waitingPrefix}${order}`, reading);
  }

  dismiss(id) { this.remove(this.refusedPrefix, id); }

  // Send all that waits, one after the other; `told` hears of each answer. Returns whether the
  // link is there.
  async send(told) {
    if (this.sending) return true;
    this.sending = true;
    try {
      for (;;) {
        const [first] = this.waiting();
        if (!first) return true;
        const { typed, ...fields } = first;
        const answer = await post("readings", { ...fields, age: Math.max(0, (Date.now() - typed) / 1000) });
        if (answer.status === 0 || answer.status === 408 || answer.status >= 500) {
          if (answer.error) told(first, answer);
          return answer.status !== 0;
        }
        if (answer.status === 401) { told(first, answer); return true; }
        if (answer.status >= 400) this.write(`${this.refusedPrefix}${first.id}`, { ...first, error: answer.error });
        this.remove(this.waitingPrefix, first.id);
        told(first, answer);
      }
    } finally {
      this.sending = false;
    }
  }

  // What is stored under a prefix, in the order typed.
  read(prefix) {
    const found = new Map(this.unsafe);
    try {
      for (let at = 0; at < localStorage.length; at += 1) {
        const key = localStorage.key(at);
        if (key.startsWith(prefix)) found.set(key, localStorage.getItem(key));
      }
    } catch { /* no storage at all: what the page itself holds must do */ }
    return [...found].filter(([key]) => key.startsWith(prefix)).sort(([a], [b]) => (a < b ? -1 : 1)).flatMap(([, text]) => parsed(text));
  }

  write(key, reading) {
    const text = JSON.stringify(reading);
    try { localStorage.setItem(key, text); } catch { this.unsafe.set(key, text); }
  }

  remove(prefix, id) {
    for (const [key, text] of [...this.unsafe]) if (key.startsWith(prefix) && parsed(text)[0]?.id === id) this.unsafe.delete(key);
    try {
      for (const key of Object.keys(localStorage)) {
        if (key.startsWith(prefix) && parsed(localStorage.getItem(key))[0]?.id === id) localStorage.removeItem(key);
      }
    } catch { /* as above */ }
  }
}

// The members of the answer with its status; 0 where the laptop could not be reached.
export async function post(path, said) {
  try {
    const response = await fetch(path, {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify(said),
      signal: AbortSignal.timeout(8000),
    });
    return { status: response.status, ...(await response.json().catch(() => ({}))) };
  } catch {
    return { status: 0 };
  }
}

// Not crypto.randomUUID: that is missing on a page without https.
export function newId() {
  return [...crypto.getRandomValues(new Uint8Array(16))].map((b) => b.toString(16).padStart(2, "0")).join("");
}

function parsed(text) {
  try { return [JSON.parse(text)]; } catch { return []; }
}
