/** Image of a camera: markers projected through its lens. */

import { hueOf } from "./colours.js";
import { cleared } from "./flat.js";
import { ABSENT, GAP, Places } from "./places.js";
import { css } from "./theme.js";

/** Projection of points in the world by one camera. */
export class Lens {
  /**
   * @param {object} camera of the header
   * @param {?Float32Array} table displacement by the lens, on a regular grid
   * @param {number} side number of grid points along each side
   */
  constructor(camera, table, side) {
    Object.assign(this, { camera, table, side });
  }

  /**
   * Write the pixel of a point into `out`.
   * @returns {boolean} whether the point is in the image
   */
  project(x, y, z, out) {
    const { T, K, near, far, size } = this.camera;
    const depth = T[8] * x + T[9] * y + T[10] * z + T[11];
    if (!(depth > near) || (far !== null && depth > far)) return false;
    const a = (T[0] * x + T[1] * y + T[2] * z + T[3]) / depth;
    const b = (T[4] * x + T[5] * y + T[6] * z + T[7]) / depth;
    let u = K[0] * a + K[1] * b + K[2];
    let v = K[3] * a + K[4] * b + K[5];
    if (this.table) {
      const [low, high, below, above] = this.camera.bounds;
      const i = ((a - low) / (high - low)) * (this.side - 1);
      const j = ((b - below) / (above - below)) * (this.side - 1);
      if (!(i >= 0 && j >= 0 && i <= this.side - 1 && j <= this.side - 1)) return false;
      u += this.bent(i, j, 0);
      v += this.bent(i, j, 1);
    }
    out[0] = u;
    out[1] = v;
    return u >= -0.5 && v >= -0.5 && u <= size[0] - 0.5 && v <= size[1] - 0.5;
  }

  bent(i, j, axis) {
    const { table, side } = this;
    const [m, n] = [Math.min(side - 2, Math.floor(i)), Math.min(side - 2, Math.floor(j))];
    const [f, g] = [i - m, j - n];
    const at = (dn, dm) => table[2 * ((n + dn) * side + m + dm) + axis];
    return (1 - g) * ((1 - f) * at(0, 0) + f * at(0, 1)) + g * ((1 - f) * at(1, 0) + f * at(1, 1));
  }
}

export class CameraImage {
  constructor(capture, state, canvas, count) {
    Object.assign(this, { capture, state, canvas, count });
    const { cameras, lensSide } = capture.header;
    this.lenses = cameras.map((camera, i) => new Lens(camera, capture.lenses[i], lensSide));
    this.places = new Places(capture);
  }

  /** Pixel of a track in the image of the selected camera, null outside the image. */
  pixelOf(track) {
    const place = [0, 0, 0];
    const pixel = [0, 0];
    const there = this.places.find(track, this.state.frame, place, 0);
    const isIn = there !== ABSENT && this.lenses[this.state.camera].project(...place, pixel);
    return isIn ? pixel : null;
  }

  /** Draw the image of the selected camera. */
  draw() {
    const { capture, state, canvas } = this;
    const lens = this.lenses[state.camera];
    const [width, height] = lens.camera.size;
    const shown = canvas.clientWidth;
    const scale = shown / width;
    if (canvas.style.height !== `${height * scale}px`) canvas.style.height = `${height * scale}px`;
    const pen = cleared(canvas, shown, height * scale);
    const { cycle, clutter, missed } = capture.header.colours;
    const place = [0, 0, 0];
    const pixel = [0, 0];
    const dot = (radius, colour, hollow) => {
      pen.beginPath();
      pen.arc((pixel[0] + 0.5) * scale, (pixel[1] + 0.5) * scale, radius, 0, 2 * Math.PI);
      pen[hollow ? "strokeStyle" : "fillStyle"] = colour;
      if (hollow) pen.stroke();
      else pen.fill();
    };
    const t = state.frame;
    for (let i = capture.clutterStart[t]; capture.T && i < capture.clutterStart[t + 1]; i++) {
      const isMissed = state.show.truth && capture.verdict?.[i] === 2;
      if (!state.show.clutter && !isMissed) continue;
      const [x, y, z] = capture.positions.subarray(3 * i, 3 * i + 3);
      if (lens.project(x, y, z, pixel)) dot(1.5, isMissed ? missed : clutter, false);
    }
    let n = 0;
    for (let k = 0; k < capture.K && capture.T; k++) {
      const there = this.places.find(k, t, place, 0);
      if (there === ABSENT || !lens.project(...place, pixel)) continue;
      n += there !== GAP;
      dot(2.5, cycle[hueOf(capture, state.show, k)] ?? clutter, there === GAP);
      if (k === state.chosen) {
        pen.lineWidth = 1.5;
        dot(6, css("--ink"), true);
        pen.lineWidth = 1;
      }
    }
    this.count.textContent = `${n} markers in the image, ${width} × ${height} pixels`;
    canvas.dataset.seen = n;
  }
}
