// Readings that wait for the link. They lie in the browser's storage, so that neither a lost link
// nor a reload takes one away; each has an id, so that the laptop records it once however often
// it is sent.

export class Queue {
  constructor(name) {
    this.key = `gtval:${name}:waiting`;
    this.refusedKey = `gtval:${name}:refused`;
    this.sending = false;
  }

  waiting() { return read(this.key); }

  refused() { return read(this.refusedKey); }

  add(reading) { write(this.key, [...this.waiting(), reading]); }

  dismiss(id) { write(this.refusedKey, this.refused().filter((one) => one.id !== id)); }

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
        const answer = await post("/readings", { ...fields, age: Math.max(0, (Date.now() - typed) / 1000) });
        if (answer.status === 0 || answer.status >= 500) {
          if (answer.error) told(first, answer);
          return answer.status !== 0;
        }
        if (answer.status === 401) { told(first, answer); return true; }
        if (answer.status >= 400) write(this.refusedKey, [...this.refused(), { ...first, error: answer.error }]);
        write(this.key, this.waiting().filter((one) => one.id !== first.id));
        told(first, answer);
      }
    } finally {
      this.sending = false;
    }
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

function read(key) {
  try { return JSON.parse(localStorage.getItem(key)) || []; } catch { return []; }
}

function write(key, list) { localStorage.setItem(key, JSON.stringify(list)); }
