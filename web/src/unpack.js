/**
 * Unpacks the data of the page from text to arrays; packing.py describes the format.
 *
 * @typedef {object} Capture
 * @property {number} T frames
 * @property {number} K tracks
 * @property {number} axes 2 or 3
 * @property {Float64Array} times seconds, one a frame
 * @property {Uint32Array} frames number of each frame in the file
 * @property {Uint32Array} starts K + 1: points of track k are starts[k] to starts[k + 1]
 * @property {Uint32Array} runsOf K + 1: runs of track k are runsOf[k] to runsOf[k + 1]
 * @property {Uint32Array} runFirst first frame of each run
 * @property {Uint32Array} runLength frames of each run
 * @property {Uint32Array} runStart first point of each run
 * @property {Uint32Array} clutterStart T + 1: points of clutter of each frame
 * @property {Float32Array} positions x, y, z of each point, metres
 * @property {?Uint8Array} confidence of each point, 255 for certain
 * @property {?Uint8Array} filled 1 where a point was filled in
 * @property {?Uint8Array} verdict of each point: 0 right, 1 wrong, 2 missed
 * @property {?Int32Array} marker true marker of each point, -1 for none
 * @property {?Uint32Array} counts points of each frame, with an editor
 * @property {?Uint16Array} point number of each point in its frame, with an editor
 * @property {Uint32Array} trouble tracks, ordered by severity, the worst first
 * @property {Float32Array} course x, y, z of the subject at evenly spaced frames
 * @property {Uint32Array} pairs tracks that are joined by lines, two by two
 * @property {Int32Array} segments segment of each track, -1 for none
 * @property {object} header all other fields
 */

/**
 * Unpack the data.
 * @param {string} text base64
 * @returns {Promise<Capture>}
 */
export async function unpack(text) {
  const bytes = await inflate(fromBase64(text.trim()));
  const length = new DataView(bytes.buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + length)));
  const arrays = {};
  let at = 4 + length;
  for (const [name, [kind, count]] of Object.entries(header.arrays)) {
    const Kind = KINDS[kind];
    arrays[name] = fromPlanes(bytes.subarray(at, at + count * Kind.BYTES_PER_ELEMENT), Kind, count);
    at += count * Kind.BYTES_PER_ELEMENT;
  }
  return capture(header, arrays);
}

const KINDS = {
  uint8: Uint8Array,
  uint16: Uint16Array,
  uint32: Uint32Array,
  int32: Int32Array,
  float32: Float32Array,
  float64: Float64Array,
};

function fromBase64(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return bytes;
}

async function inflate(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Merge byte planes. All machines that run browsers are little-endian. */
function fromPlanes(bytes, Kind, count) {
  const size = Kind.BYTES_PER_ELEMENT;
  const whole = new Uint8Array(count * size);
  for (let b = 0; b < size; b++) {
    const plane = bytes.subarray(b * count, (b + 1) * count);
    for (let i = 0; i < count; i++) whole[i * size + b] = plane[i];
  }
  return new Kind(whole.buffer);
}

function capture(header, arrays) {
  const T = arrays.times.length;
  const K = header.names.length;
  const n = arrays.x.length;
  const runsOf = new Uint32Array(K + 1);
  for (const k of arrays.runTrack) runsOf[k + 1] += 1;
  const runStart = new Uint32Array(arrays.runFirst.length);
  for (let r = 1; r < runStart.length; r++) runStart[r] = runStart[r - 1] + arrays.runLength[r - 1];
  for (let k = 0; k < K; k++) runsOf[k + 1] += runsOf[k];
  const clutterStart = new Uint32Array(T + 1);
  clutterStart[0] = arrays.starts[K];
  for (let t = 0; t < T; t++) clutterStart[t + 1] = clutterStart[t] + arrays.clutter[t];
  const positions = new Float32Array(3 * n);
  const begins = [...new Set(arrays.starts)].filter((i) => i < n);
  ["x", "y", "z"].forEach((name, axis) => {
    decode(arrays[name], begins, header.order, (i, cell) => {
      positions[3 * i + axis] = header.grid[0][axis] + cell * header.grid[1][axis];
    });
  });
  return {
    T, K, axes: header.axes, header, positions, runsOf, runStart, clutterStart,
    times: arrays.times, frames: arrays.frames, segments: arrays.segments, starts: arrays.starts, trouble: arrays.trouble, pairs: arrays.pairs,
    course: arrays.course,
    runFirst: arrays.runFirst, runLength: arrays.runLength,
    confidence: arrays.confidence ?? null, filled: arrays.filled ?? null,
    counts: arrays.counts ?? null, point: arrays.point ?? null,
    verdict: arrays.verdict ?? null, marker: arrays.marker ?? null,
    lenses: header.cameras.map((_, i) => arrays[`lens${i}`] ?? null),
  };
}

/** Undo the prediction from one or two cells before, sequence by sequence. */
function decode(rest, begins, order, put) {
  begins.forEach((begin, s) => {
    const end = begins[s + 1] ?? rest.length;
    let cell = 0;
    let pace = 0;
    for (let i = begin; i < end; i++) {
      const zigzag = rest[i];
      const left = (zigzag >>> 1) ^ -(zigzag & 1);
      const before = cell;
      const along = order === 2 && i > begin + 1 ? pace : 0;
      cell = (cell + along + left) & 65535;
      pace = cell - before;
      put(i, cell);
    }
  });
}
