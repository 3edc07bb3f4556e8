// Readings that were written down elsewhere go into a journal only when somebody wants to go on.

import { $, ask, words } from "/static/frame.js";

$("begin").addEventListener("click", async () => {
  const answer = await ask("begin", {}, 60);
  if (answer.status === 200) location.reload();
  else $("message").textContent = answer.error ?? words.frame.no_server;
});
