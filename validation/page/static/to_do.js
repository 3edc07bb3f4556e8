// The list of what to do, and the run that makes it anew.

import { $, ask, data, replace, said, watch, words } from "/static/frame.js";

const text = words.panel;

function show(run) {
  const working = run.state === "running" || run.state === "stopping";
  $("run").hidden = working;
  $("stop").hidden = !working;
  $("stop").disabled = run.state === "stopping";
  $("progress").hidden = !working;
  $("progress").value = run.share;
  const told = {
    none: text.run_hint,
    running: [said(text.running, run), run.by && said(text.started_by, { name: run.by })].filter(Boolean).join(" · "),
    stopping: text.stopping, done: text.done, stopped: text.stopped, failed: text.failed,
  }[run.state];
  if ($("run-text").textContent !== told) $("run-text").textContent = told;
  $("run-error").hidden = run.state !== "failed";
  const error = run.state === "failed" ? run.what : "";
  if ($("run-error").textContent !== error) $("run-error").textContent = error;
}

async function press(action) {
  const focused = document.activeElement?.id;
  const answer = await ask(`/to_do/${action}`, {});
  if (answer.run) show(answer.run);
  else { $("run-error").hidden = false; $("run-error").textContent = answer.error ?? words.frame.no_server; }
  if (focused === "run" || focused === "stop") ($("run").hidden ? $("stop") : $("run")).focus();
}

$("run").addEventListener("click", () => press("run"));
$("stop").addEventListener("click", () => press("stop"));
show(data.run);
watch("to_do", async () => { await replace("standing", "/to_do/standing"); await replace("lists", "/to_do/lists"); }, (answer) => show(answer.run));
