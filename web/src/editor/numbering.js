/**
 * Detections of the page by number, in the order of frames, with the track of each; the arrays of
 * the player are computed from them again after each change.
 */

const HIDDEN = -2; // not on the page

export class Numbering {
  /** @param {import("../unpack.js").Capture} capture */
  constructor(capture) {
    this.capture = capture;
    const { T, K, counts, point } = capture;
    this.offsets = new Uint32Array(T + 1);
    for (let t = 0; t < T; t++) this.offsets[t + 1] = this.offsets[t] + counts[t];
    const n = this.offsets[T];
    this.label = new Int32Array(n).fill(HIDDEN);
    this.frame = new Uint32Array(n);
    for (let t = 0; t < T; t++) this.frame.fill(t, this.offsets[t], this.offsets[t + 1]);
    this.position = new Float32Array(3 * n);
    this.confidence = capture.confidence && new Uint8Array(n);
    /** Number of the detection of each point of the player. */
    this.numberOf = new Uint32Array(point.length);
    const put = (row, t, track) => {
      const i = this.offsets[t] + point[row];
      this.label[i] = track;
      for (let a = 0; a < 3; a++) this.position[3 * i + a] = capture.positions[3 * row + a];
      if (this.confidence) this.confidence[i] = capture.confidence[row];
      this.numberOf[row] = i;
    };
    for (let k = 0; k < K; k++) {
      for (let r = capture.runsOf[k]; r < capture.runsOf[k + 1]; r++) {
        for (let j = 0; j < capture.runLength[r]; j++) {
          put(capture.runStart[r] + j, capture.runFirst[r] + j, k);
        }
      }
    }
    for (let t = 0; t < T; t++) {
      for (let row = capture.clutterStart[t]; row < capture.clutterStart[t + 1]; row++) put(row, t, -1);
    }
  }

  /** Compute all arrays of the player from the labels. */
  rebuild() {
    const { capture, label, frame, position } = this;
    const K = capture.header.names.length;
    const starts = new Uint32Array(K + 1);
    let clutter = 0;
    for (let i = 0; i < label.length; i++) {
      const k = label[i];
      if (k >= 0) starts[k + 1] += 1;
      else if (k > HIDDEN) clutter += 1;
    }
    for (let k = 0; k < K; k++) starts[k + 1] += starts[k];
    const n = starts[K] + clutter;
    const at = starts.slice();
    const numberOf = new Uint32Array(n);
    const positions = new Float32Array(3 * n);
    const confidence = this.confidence && new Uint8Array(n);
    const clutterStart = new Uint32Array(capture.T + 1);
    for (let i = 0; i < label.length; i++) {
      const k = label[i];
      if (k === HIDDEN) continue;
      const row = k < 0 ? at[K]++ : at[k]++;
      if (k < 0) clutterStart[frame[i] + 1] += 1;
      numberOf[row] = i;
      positions[3 * row] = position[3 * i];
      positions[3 * row + 1] = position[3 * i + 1];
      positions[3 * row + 2] = position[3 * i + 2];
      if (confidence) confidence[row] = this.confidence[i];
    }
    clutterStart[0] = starts[K];
    for (let t = 0; t < capture.T; t++) clutterStart[t + 1] += clutterStart[t];
    this.numberOf = numberOf;
    Object.assign(capture, { K, starts, positions, confidence, clutterStart, filled: null });
    this.findRuns(K, starts);
    const listed = new Set(capture.trouble);
    const added = [...Array(K).keys()].filter((k) => !listed.has(k));
    const hasPoints = (k) => starts[k + 1] > starts[k];
    capture.trouble = Uint32Array.from([...capture.trouble, ...added].filter(hasPoints));
  }

  /** Largest number of points of clutter in a frame. */
  get mostClutter() {
    const { clutterStart, T } = this.capture;
    let most = 0;
    for (let t = 0; t < T; t++) most = Math.max(most, clutterStart[t + 1] - clutterStart[t]);
    return most;
  }

  findRuns(K, starts) {
    const { frame, numberOf } = this;
    const most = starts[K];
    const [first, length, start] = [0, 0, 0].map(() => new Uint32Array(most));
    const runsOf = new Uint32Array(K + 1);
    let n = 0;
    for (let k = 0; k < K; k++) {
      for (let row = starts[k]; row < starts[k + 1]; row++) {
        const t = frame[numberOf[row]];
        if (row > starts[k] && t === first[n - 1] + length[n - 1]) length[n - 1] += 1;
        else {
          first[n] = t;
          length[n] = 1;
          start[n++] = row;
        }
      }
      runsOf[k + 1] = n;
    }
    Object.assign(this.capture, {
      runsOf, runFirst: first.slice(0, n), runLength: length.slice(0, n), runStart: start.slice(0, n),
    });
  }

  /** Number of the last detection of a track before a frame, -1 for none. */
  before(track, t) {
    const row = this.search(track, t) - 1;
    return row < this.capture.starts[track] ? -1 : this.numberOf[row];
  }

  /** Number of the first detection of a track at or after a frame, -1 for none. */
  from(track, t) {
    const row = this.search(track, t);
    return row >= this.capture.starts[track + 1] ? -1 : this.numberOf[row];
  }

  /** Number of the detection of a track nearest to a frame, -1 for none; `not` is no frame of it. */
  nearest(track, t, not = -1) {
    let [a, b] = [this.before(track, t), this.from(track, t)];
    if (b >= 0 && this.frame[b] === not) b = this.from(track, t + 1);
    if (a >= 0 && this.frame[a] === not) a = this.before(track, not);
    if (a < 0 || b < 0) return Math.max(a, b);
    return t - this.frame[a] < this.frame[b] - t ? a : b;
  }

  /** First row of a track at or after a frame. */
  search(track, t) {
    let low = this.capture.starts[track];
    let high = this.capture.starts[track + 1];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.frame[this.numberOf[middle]] < t) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** Frame and number in the frame of a detection, as in the file of the edits. */
  place(i) {
    const t = this.frame[i];
    return [t, i - this.offsets[t]];
  }
}
