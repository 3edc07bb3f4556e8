// The screen stays awake while the page is shown, where the browser lets a page ask for that: only
// on pages that came encrypted, or from this very machine.

export function stayAwake(tell) {
  if (!navigator.wakeLock) {
    const how = window.isSecureContext ? "this browser cannot keep it awake" : "a page can keep it awake only if the laptop serves it with --tls";
    tell(`The screen may go dark: ${how}. Set the longest time before that in the settings of this device.`);
    return;
  }
  const ask = async () => {
    try {
      await navigator.wakeLock.request("screen");
      tell("");
    } catch {
      tell("The screen may go dark: this device saves power. Plug it in, or set the longest time before that in its settings.");
    }
  };
  // The lock ends whenever another page or program is looked at.
  document.addEventListener("visibilitychange", () => { if (document.visibilityState === "visible") ask(); });
  ask();
}
