/** Position of a track in a frame. */

export const ABSENT = 0;
export const SEEN = 1;
export const GAP = 2;

/** Positions of one capture. The last run of each track is stored, so that playing needs no search. */
export class Places {
  /** @param {import("./unpack.js").Capture} capture */
  constructor(capture) {
    this.capture = capture;
    this.last = Uint32Array.from(capture.runsOf.subarray(0, capture.K));
    /** Index of the point that was looked up last, -1 in a gap. */
    this.point = -1;
  }

  /**
   * Write the position of track k in frame t into `out`, from `offset` on.
   * In a gap the position is interpolated linearly.
   * @returns {number} ABSENT, SEEN or GAP
   */
  find(k, t, out, offset) {
    const c = this.capture;
    const r = this.run(k, t);
    this.point = -1;
    if (r < 0) return ABSENT;
    const begin = c.runFirst[r];
    const end = begin + c.runLength[r];
    if (t < end) {
      this.point = c.runStart[r] + t - begin;
      for (let i = 0; i < 3; i++) out[offset + i] = c.positions[3 * this.point + i];
      return SEEN;
    }
    if (r + 1 >= c.runsOf[k + 1]) return ABSENT;
    const a = c.runStart[r] + c.runLength[r] - 1;
    const from = c.times[end - 1];
    const share = (c.times[t] - from) / (c.times[c.runFirst[r + 1]] - from);
    for (let i = 0; i < 3; i++) {
      const here = c.positions[3 * a + i];
      out[offset + i] = here + share * (c.positions[3 * a + 3 + i] - here);
    }
    return GAP;
  }

  /** Index of the last run of track k that begins by frame t, -1 before the first. */
  run(k, t) {
    const { runsOf, runFirst } = this.capture;
    const stop = runsOf[k + 1];
    let low = runsOf[k];
    if (low === stop || runFirst[low] > t) return -1;
    const hint = this.last[k];
    // The editor changes runs and adds tracks.
    if (hint >= low && hint < stop && runFirst[hint] <= t && (hint + 1 === stop || runFirst[hint + 1] > t)) return hint;
    let high = stop;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (runFirst[middle] <= t) low = middle;
      else high = middle;
    }
    this.last[k] = low;
    return low;
  }
}

/** Last frame at or before a time. */
export function frameAt(times, time) {
  let low = 0;
  let high = times.length;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle;
    else high = middle;
  }
  return low;
}
