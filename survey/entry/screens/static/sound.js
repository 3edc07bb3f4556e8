// Confirmation that needs no look: a high beep for a reading that is in, two low ones for one to
// look at, or the digits spoken. The same always stands on the page as text.

let context = null;

// A browser lets a page make sounds only after the person has touched it.
export function allowSound() {
  const allow = () => { if (window.AudioContext && navigator.userActivation?.hasBeenActive !== false) context ??= new AudioContext(); };
  document.addEventListener("pointerup", allow);
  document.addEventListener("keyup", allow);
}

export function confirmBySound(kind, text) {
  const way = document.querySelector("input[name=sound]:checked")?.value;
  if (way === "beep") beep(kind);
  if (way === "speak") speak(kind, text);
}

function beep(kind) {
  if (!context) return;
  const tones = { ok: [[880, 0]], look: [[220, 0], [220, 0.25]], waiting: [[440, 0]] }[kind] ?? [];
  for (const [pitch, after] of tones) {
    const tone = context.createOscillator();
    const volume = context.createGain();
    tone.frequency.value = pitch;
    volume.gain.value = 0.3;
    tone.connect(volume).connect(context.destination);
    tone.start(context.currentTime + after);
    tone.stop(context.currentTime + after + 0.15);
  }
}

function speak(kind, text) {
  if (!window.speechSynthesis) return;
  const said = { look: "Look! ", waiting: "Waiting. " }[kind] ?? "";
  speechSynthesis.cancel();
  const words = new SpeechSynthesisUtterance(said + [...text].join(" ").replace(/[.,]/g, "point"));
  words.lang = "en";
  speechSynthesis.speak(words);
}
