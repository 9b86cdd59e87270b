/** The present frame of a stream, in the form of a capture of one frame that the stage draws. */

const CLUTTER = 512; // points that are drawn at most
const SMOOTH = 0.3; // seconds

export class LiveCapture {
  /** @param {object} header colours, vertical axis and radius of the markers */
  constructor(header) {
    this.T = 1;
    this.axes = 3;
    this.times = new Float64Array(1);
    this.frames = new Uint32Array(1);
    this.course = new Float32Array(3);
    this.pairs = new Uint32Array(0);
    this.header = {
      ...header, cameras: [], opens: 0, names: [], box: [[-1, -1, 0], [1, 1, 2]],
      subject: [[-0.5, -0.5, -0.9], [0.5, 0.5, 0.9]],
    };
    /** Place in the arrays of each identity. */
    this.slots = new Map();
    this.room(64);
  }

  /** Make room for so many tracks. */
  room(K) {
    const before = this.positions;
    this.K = K;
    this.runsOf = Uint32Array.from({ length: K + 1 }, (_, k) => k);
    this.runStart = this.runsOf.subarray(0, K);
    this.runFirst = new Uint32Array(K).fill(1); // after the only frame: absent
    this.runLength = new Uint32Array(K).fill(1);
    this.segments = new Int32Array(K).fill(-1);
    this.positions = new Float32Array(3 * (K + CLUTTER));
    this.filled = new Uint8Array(K + CLUTTER);
    this.clutterStart = Uint32Array.of(K, K);
    this.ids = new Int32Array(K).fill(-1);
    for (const [id, k] of this.slots) this.ids[k] = id;
    if (before) this.positions.set(before.subarray(0, Math.min(before.length, 3 * K)));
  }

  /**
   * Take a frame.
   * @returns {boolean} whether there is room for more tracks than before
   */
  take({ frame, time, ids, seen, at, clutter }) {
    const step = time - this.times[0];
    this.frames[0] = frame;
    this.times[0] = time;
    const grows = this.assign(ids);
    this.runFirst.fill(1);
    ids.forEach((id, i) => {
      const k = this.slots.get(id);
      if (at[3 * i] === null) return;
      this.runFirst[k] = 0;
      this.filled[k] = seen[i] ? 0 : 1;
      for (let a = 0; a < 3; a++) this.positions[3 * k + a] = at[3 * i + a] / 1e4;
    });
    const n = Math.min(clutter.length / 3, CLUTTER);
    for (let i = 0; i < 3 * n; i++) this.positions[3 * this.K + i] = clutter[i] / 1e4;
    this.clutterStart[1] = this.K + n;
    this.follow(step);
    return grows;
  }

  /** Give every identity a place; places of identities that are gone are used again. */
  assign(ids) {
    const present = new Set(ids);
    const fresh = ids.filter((id) => !this.slots.has(id));
    if (!fresh.length) return false;
    for (const [id, k] of this.slots) {
      if (present.has(id)) continue;
      this.slots.delete(id);
      this.ids[k] = -1;
    }
    const grows = present.size > this.K;
    if (grows) this.room(2 * present.size);
    let k = 0;
    for (const id of fresh) {
      while (this.ids[k] >= 0) k++;
      this.ids[k] = id;
      this.slots.set(id, k);
      this.header.names[k] = `track ${id}`;
    }
    return grows;
  }

  rename(names) {
    for (const [id, k] of this.slots) this.header.names[k] = names[id] ?? `track ${id}`;
  }

  /** The middle of the seen markers, with which the view moves, `step` seconds after the last. */
  follow(step) {
    const sum = [0, 0, 0];
    let n = 0;
    for (let k = 0; k < this.K; k++) {
      if (this.runFirst[k] !== 0 || this.filled[k]) continue;
      for (let a = 0; a < 3; a++) sum[a] += this.positions[3 * k + a];
      n++;
    }
    if (!n) return;
    // Smooth, so that an occlusion does not move the view.
    const share = this.isPlaced && step > 0 ? 1 - Math.exp(-step / SMOOTH) : 1;
    for (let a = 0; a < 3; a++) this.course[a] += share * (sum[a] / n - this.course[a]);
    this.isPlaced = true;
  }

  /** Corners of the box of the markers that are seen. */
  box() {
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    for (let k = 0; k < this.K; k++) {
      if (this.runFirst[k] !== 0) continue;
      for (let a = 0; a < 3; a++) {
        low[a] = Math.min(low[a], this.positions[3 * k + a]);
        high[a] = Math.max(high[a], this.positions[3 * k + a]);
      }
    }
    return [low, high];
  }
}
