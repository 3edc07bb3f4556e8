// The report of the last run, always the newest.

import { $, replace, watch } from "/static/frame.js";

const frame = $("document");

function load() {
  const place = /^#[\w-]+$/.test(location.hash) ? location.hash : "";
  frame.src = `/report/document?at=${Date.now()}${place}`;
}

if (!frame.hidden) load();
window.addEventListener("hashchange", load);
watch("report", async () => {
  await replace("standing", "/report/standing");
  frame.hidden = false;
  load();
});
