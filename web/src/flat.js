/** 2-D canvases with the resolution of the screen. */

/**
 * Set a canvas to the size at which it is shown, and clear it.
 * @returns {CanvasRenderingContext2D} in CSS pixels
 */
export function cleared(canvas, width = canvas.clientWidth, height = canvas.clientHeight) {
  const ratio = Math.min(2, window.devicePixelRatio || 1);
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  return pen;
}

export const FONT = "12px system-ui, sans-serif";
