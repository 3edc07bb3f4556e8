import { $, ask, words } from "./frame.js";

const message = $("message");
if (location.hash.length > 1 && !location.hash.includes("section")) {
  $("code").value = decodeURIComponent(location.hash.slice(1));
  history.replaceState(null, "", location.pathname); // the code is nobody else's business
  $("name").focus();
} else $("code").focus();

$("join").addEventListener("submit", async (event) => {
  event.preventDefault();
  const answer = await ask("/join", { code: $("code").value, name: $("name").value });
  if (answer.status === 200) location.reload();
  else message.textContent = answer.error ?? words.frame.no_server;
});
window.addEventListener("hashchange", () => location.reload());
