// What all pictures that are drawn here share: at most once a frame, and as sharp as the screen.

export class Drawing {
  constructor(canvas) {
    this.canvas = canvas;
    this.waiting = false;
  }

  draw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => { this.waiting = false; this.paint(); });
  }
}

// An empty canvas with as many dots as the screen: its pen, and its width and height in pixels.
export function emptied(canvas) {
  const [width, height, dense] = [canvas.clientWidth, canvas.clientHeight, devicePixelRatio || 1];
  if (canvas.width !== Math.round(width * dense)) canvas.width = Math.round(width * dense);
  if (canvas.height !== Math.round(height * dense)) canvas.height = Math.round(height * dense);
  const pen = canvas.getContext("2d");
  pen.setTransform(dense, 0, 0, dense, 0, 0);
  pen.clearRect(0, 0, width, height);
  return [pen, width, height];
}
