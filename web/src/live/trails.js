/** Trails of a stream: the positions of the last frames, in a ring. */

import { Color } from "three";

import { Lines } from "../lines.js";

const LENGTH = 64; // positions of a trail
const STEP = 0.02; // seconds between two positions
const MAX_TRAILS = 400;

export class LiveTrails extends Lines {
  constructor(capture) {
    super(LENGTH * Math.min(capture.K, MAX_TRAILS));
    this.capture = capture;
    this.cycle = capture.header.colours.cycle.map((c) => new Color(c));
    this.ring = new Float32Array(3 * LENGTH * capture.K).fill(NaN);
    this.when = new Float64Array(LENGTH).fill(-Infinity);
    this.at = 0;
  }

  /** Keep the positions of the present frame. */
  keep() {
    const { K, positions, runFirst, filled } = this.capture;
    const now = this.capture.times[0];
    // The newest position follows the marker until it is far enough from the one before.
    if (now - this.when[(this.at - 1 + LENGTH) % LENGTH] >= STEP) this.at = (this.at + 1) % LENGTH;
    this.when[this.at] = now;
    for (let k = 0; k < K; k++) {
      const isThere = runFirst[k] === 0 && !filled[k];
      for (let a = 0; a < 3; a++) {
        this.ring[3 * (this.at * K + k) + a] = isThere ? positions[3 * k + a] : NaN;
      }
    }
  }

  /** @param {import("../state.js").State} state */
  update(state) {
    this.clear();
    const { K } = this.capture;
    const seconds = state.show.trails;
    const now = this.when[this.at];
    for (let back = 0; back + 1 < LENGTH && seconds > 0; back++) {
      const [a, b] = [back, back + 1].map((n) => (this.at - n + LENGTH) % LENGTH);
      const age = now - this.when[b];
      if (!(age >= 0 && age <= seconds)) break;
      const [from, to] = [now - this.when[a], age].map((s) => 0.8 * (1 - s / seconds));
      for (let k = 0; k < K; k++) {
        const [p, q] = [3 * (a * K + k), 3 * (b * K + k)];
        if (Number.isNaN(this.ring[p]) || Number.isNaN(this.ring[q])) continue;
        this.add(this.ring, p, this.ring, q, this.cycle[k % this.cycle.length], from, to);
      }
    }
    this.done();
  }
}
