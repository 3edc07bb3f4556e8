// Decisions that have no answer yet: kept in the browser, sent in their order, each until it has
// one. What the link swallows waits; sent twice, it counts once. Each has an entry of its own in
// the browser's storage, under the campaign's key: neither another page nor another campaign that
// is served at the same address takes it away.

import { ask, campaign, said, words } from "./frame.js";

// Refused for good: the same request would be refused again. All other answers mean "not now".
const FINAL = [400, 403, 404, 409, 413, 415, 422];

export class Outbox {
  // about: the name of what a decision is about. told: called with why one has not arrived.
  constructor(panel, path, about, told) {
    this.prefix = `gtval:${panel}:${campaign}:`;
    this.path = path;
    this.about = about;
    this.told = told;
    this.unstored = new Map(); // what the browser would not store: kept as long as the page is open
    this.number = 0;
    this.sending = null;
  }

  // All that waits, the oldest first: pairs of key and decision.
  get all() {
    const found = new Map(this.unstored);
    try {
      for (const key of Object.keys(localStorage)) if (key.startsWith(this.prefix)) found.set(key, localStorage.getItem(key));
    } catch { /* no storage: the page itself holds them */ }
    return [...found].sort(([a], [b]) => (a < b ? -1 : 1)).flatMap(([key, content]) => {
      try { return [[key, JSON.parse(content)]]; } catch { return []; }
    });
  }

  // Keep one under a name of its own, and send what waits; whether all of it has arrived.
  async add(one) {
    this.number += 1;
    const order = `${String(Date.now()).padStart(15, "0")}-${String(this.number).padStart(6, "0")}`;
    const id = `${order}-${Math.random().toString(36).slice(2)}`;
    const content = JSON.stringify({ ...one, id });
    try { localStorage.setItem(this.prefix + id, content); } catch { this.unstored.set(this.prefix + id, content); }
    if (this.sending) await this.sending; // what is sent now may have been counted before
    return this.flush();
  }

  flush() {
    this.sending ??= this.send().finally(() => { this.sending = null; });
    return this.sending;
  }

  async send() {
    for (let [first] = this.all; first; [first] = this.all) {
      const [key, one] = first;
      const answer = await ask(this.path, one);
      const arrived = answer.status === 200;
      const isFinal = FINAL.includes(answer.status);
      if (!arrived) this.tell(isFinal ? words.frame.refused : words.frame.kept, one, answer);
      if (!arrived && !isFinal) return false;
      this.unstored.delete(key);
      try { localStorage.removeItem(key); } catch { /* as above */ }
      if (!arrived) return false;
    }
    return true;
  }

  tell(content, one, answer) {
    const problem = answer.error ?? words.frame.no_server;
    this.told(said(content, { about: this.about(one), problem: /[.?!]$/.test(problem) ? problem : `${problem}.` }));
  }
}
