/** Surroundings of the markers: the floor with its axes, and the cameras. */

import { Vector3 } from "three";

import { Lines } from "./lines.js";

/** A floor of squares, with a round number as their size. */
export class Floor extends Lines {
  constructor(capture) {
    super(400);
    this.capture = capture;
  }

  /**
   * @param {string} up axis that points up
   * @param {import("three").Color} ink
   */
  draw(up, ink) {
    this.clear();
    const [low, high] = this.capture.header.box;
    const u = "xyz".indexOf(up);
    const [a, b] = [0, 1, 2].filter((i) => i !== u);
    const extent = Math.max(high[a] - low[a], high[b] - low[b], 1e-3);
    this.cell = roundSize(extent / 8);
    const flat = this.capture.axes === 2;
    // The floor is at the origin if the lowest points are near it, else at the lowest point.
    const floor = flat || Math.abs(low[u]) < 0.15 * Math.max(extent, high[u] - low[u]) ? 0 : low[u];
    const from = [a, b].map((i) => (Math.floor(low[i] / this.cell) - 1) * this.cell);
    const to = [a, b].map((i) => (Math.ceil(high[i] / this.cell) + 1) * this.cell);
    const line = (s, t, colour, alpha) => this.add(s, 0, t, 0, colour, alpha, alpha);
    const place = (x, y) => {
      const p = [0, 0, 0];
      p[a] = x;
      p[b] = y;
      p[u] = floor;
      return p;
    };
    for (let x = from[0]; x <= to[0] + 1e-9; x += this.cell) {
      line(place(x, from[1]), place(x, to[1]), ink, Math.abs(x) < 1e-9 ? 0.4 : 0.16);
    }
    for (let y = from[1]; y <= to[1] + 1e-9; y += this.cell) {
      line(place(from[0], y), place(to[0], y), ink, Math.abs(y) < 1e-9 ? 0.4 : 0.16);
    }
    this.done();
  }
}

/** Round up to 1, 2 or 5 times a power of ten. */
function roundSize(size) {
  const ten = 10 ** Math.floor(Math.log10(size));
  return ten * [1, 2, 5, 10].find((m) => m * ten >= size * 0.999);
}

/** Cameras as pyramids that open in their viewing direction. */
export class Frustums extends Lines {
  constructor(capture, size) {
    super(8 * capture.header.cameras.length);
    this.cameras = capture.header.cameras;
    const [low, high] = capture.header.box;
    const away = this.cameras.map((camera) =>
      Math.hypot(...camera.centre.map((x, i) => x - (low[i] + high[i]) / 2)),
    );
    // Large enough to be visible in a view of all cameras, and never larger than the scene.
    this.size = Math.min(0.3 * size, 0.07 * Math.max(size, ...away));
  }

  draw(chosen, shown, ink, accent) {
    this.clear();
    this.letters = [];
    this.cameras.forEach((camera, i) => {
      if (!shown) return;
      const colour = i === chosen ? accent : ink;
      const alpha = i === chosen ? 1 : 0.45;
      const tips = camera.corners.map((ray) =>
        ray.map((x, axis) => camera.centre[axis] + this.size * x),
      );
      tips.forEach((tip, n) => {
        this.add(camera.centre, 0, tip, 0, colour, alpha, alpha);
        this.add(tip, 0, tips[(n + 1) % 4], 0, colour, alpha, alpha);
      });
      this.letters.push({
        text: camera.name, place: new Vector3(...camera.centre), colour: null, chosen: i === chosen,
      });
    });
    this.done();
  }
}
