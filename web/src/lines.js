/** Coloured line segments: trails, connections, the floor, cameras. */

import {
  BufferAttribute, BufferGeometry, Color, DynamicDrawUsage, LineBasicMaterial, LineSegments,
} from "three";

import { hueOf } from "./colours.js";
import { frameAt, SEEN } from "./places.js";

const MAX_SAMPLES = 80; // of a trail
const MAX_TRAILS = 400; // tracks with a trail at the same time

export class Lines {
  /** @param {number} most largest number of segments */
  constructor(most) {
    this.geometry = new BufferGeometry();
    this.position = new BufferAttribute(new Float32Array(6 * most), 3);
    this.colour = new BufferAttribute(new Float32Array(8 * most), 4);
    this.position.setUsage(DynamicDrawUsage);
    this.colour.setUsage(DynamicDrawUsage);
    this.geometry.setAttribute("position", this.position);
    this.geometry.setAttribute("color", this.colour);
    const material = new LineBasicMaterial({
      vertexColors: true, transparent: true, depthWrite: false,
    });
    this.object = new LineSegments(this.geometry, material);
    this.object.frustumCulled = false;
    this.most = most;
    this.n = 0;
  }

  clear() {
    this.n = 0;
  }

  /** Add a segment from place a of one array to place b of another, with the opacity of each end. */
  add(from, a, to, b, colour, alphaFrom, alphaTo) {
    if (this.n >= this.most) return;
    const p = 6 * this.n;
    const c = 8 * this.n++;
    for (let i = 0; i < 3; i++) {
      this.position.array[p + i] = from[a + i];
      this.position.array[p + 3 + i] = to[b + i];
    }
    this.colour.array.set([colour.r, colour.g, colour.b, alphaFrom], c);
    this.colour.array.set([colour.r, colour.g, colour.b, alphaTo], c + 4);
  }

  done() {
    this.geometry.setDrawRange(0, 2 * this.n);
    this.position.needsUpdate = true;
    this.colour.needsUpdate = true;
  }
}

/** Trails: the last positions of each marker. */
export class Trails extends Lines {
  constructor(capture, places) {
    super(Math.min(capture.K + 64, MAX_TRAILS) * MAX_SAMPLES);
    this.capture = capture;
    this.places = places;
    this.cycle = capture.header.colours.cycle.map((c) => new Color(c));
    this.clutter = new Color(capture.header.colours.clutter);
    this.buffer = [new Float32Array(3), new Float32Array(3)];
  }

  /** @param {import("./state.js").State} state */
  update(state) {
    this.clear();
    const { capture, places } = this;
    const seconds = state.show.trails;
    if (seconds > 0 && capture.T > 1) {
      const t = state.frame;
      const first = frameAt(capture.times, capture.times[t] - seconds);
      const step = Math.max(1, Math.ceil((t - first) / MAX_SAMPLES));
      for (let k = 0; k < capture.K; k++) {
        let [now, before] = this.buffer;
        let was = places.find(k, t, now, 0);
        for (let s = t - step; s >= first && (was || s === t - step); s -= step) {
          [now, before] = [before, now];
          const is = places.find(k, s, now, 0);
          if (is && was) {
            const dim = is === SEEN && was === SEEN ? 0.8 : 0.25;
            const share = (x) => dim * (1 - (t - x) / (t - first + 1));
            const colour = this.cycle[hueOf(capture, state.show, k)] ?? this.clutter;
            this.add(before, 0, now, 0, colour, share(s + step), share(s));
          }
          was = is;
        }
      }
    }
    this.done();
  }
}

/** Lines between markers with a stable distance. */
export class Connections extends Lines {
  constructor(capture, places) {
    super(capture.pairs.length / 2);
    this.capture = capture;
    this.places = places;
    this.ends = new Float32Array(6);
  }

  /**
   * @param {import("./state.js").State} state
   * @param {Color} ink
   */
  update(state, ink) {
    this.clear();
    const { pairs, T } = this.capture;
    for (let i = 0; i < pairs.length && state.show.lines && T; i += 2) {
      const a = this.places.find(pairs[i], state.frame, this.ends, 0);
      const b = this.places.find(pairs[i + 1], state.frame, this.ends, 3);
      const alpha = a === SEEN && b === SEEN ? 0.45 : 0.18;
      if (a && b) this.add(this.ends, 0, this.ends, 3, ink, alpha, alpha);
    }
    this.done();
  }
}
