// Decisions that have no answer yet: kept in the browser, sent in their order, each until it has
// one. What the link swallows waits; sent twice, it counts once.

import { ask } from "./frame.js";

export class Outbox {
  // told: called with a problem that the server names, or with null where it cannot be reached.
  constructor(name, path, told) {
    this.name = name;
    this.path = path;
    this.told = told;
    this.kept = [];
    this.sending = false;
  }

  get all() { try { return JSON.parse(localStorage.getItem(this.name) ?? "[]"); } catch { return this.kept; } }
  set all(some) {
    this.kept = some;
    try { localStorage.setItem(this.name, JSON.stringify(some)); } catch { /* no storage: the page itself holds them */ }
  }

  // Keep one under a name of its own, and send what waits; whether all of it has arrived.
  async add(one) {
    const id = `${Date.now().toString(36)}-${Math.random().toString(36).slice(2)}`;
    this.all = [...this.all, { ...one, id }];
    return this.flush();
  }

  async flush() {
    if (this.sending) return false;
    this.sending = true;
    try {
      for (let all = this.all; all.length; all = this.all) {
        const answer = await ask(this.path, all[0]);
        if (answer.status === 0 || answer.status >= 500 || answer.status === 401) { this.told(null); return false; }
        this.all = this.all.slice(1);
        if (answer.status !== 200) { this.told(answer.error ?? ""); return false; }
      }
      return true;
    } finally { this.sending = false; }
  }
}
