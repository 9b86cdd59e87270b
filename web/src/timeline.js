/** Timeline: one strip for each track with its detections, confidence and errors over time. */

import { Color } from "three";

import { cleared, FONT } from "./flat.js";
import { frameAt } from "./places.js";
import { css } from "./theme.js";

const ROW = 15;
const RULER = 20;
const NAMES = 96; // width of the names
const LEVELS = 16; // of confidence

// Content of a cell of a strip: the worst of its frames. From SURE on, confidence falls.
const [NONE, SPAN, SURE, WRONG] = [0, 1, 2, 2 + LEVELS];

/** Level of a confidence: 0 at a confidence of 1, the last at 0.5 and below. */
function doubt(confidence) {
  const share = Math.min(1, (255 - confidence) / 127.5);
  return SURE + Math.round((LEVELS - 1) * Math.sqrt(share));
}

export class Timeline {
  constructor(capture, state, { box, canvas, rows }) {
    Object.assign(this, { capture, state, box, canvas, rows });
    this.sort("trouble");
    box.addEventListener("scroll", () => this.draw());
    canvas.addEventListener("click", (event) => this.click(event));
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  /** @param {"trouble" | "first" | "name"} by */
  sort(by) {
    const { capture } = this;
    const { names } = capture.header;
    this.order = [...capture.trouble];
    if (by === "first") {
      const first = (k) => capture.runFirst[capture.runsOf[k]];
      this.order.sort((a, b) => first(a) - first(b) || a - b);
    } else if (by === "name") {
      this.order.sort((a, b) => names[a].localeCompare(names[b], "en", { numeric: true }));
    }
    this.rowOf = new Map(this.order.map((k, row) => [k, row]));
  }

  /** Adapt to the size of the page, and compute the strips again. */
  resize() {
    this.box.classList.toggle("short", this.order.length < 8);
    this.rows.style.height = `${RULER + ROW * this.order.length + 6}px`;
    this.canvas.style.height = `${this.box.clientHeight}px`;
    this.width = this.box.clientWidth;
    this.cells = Math.max(1, Math.floor(this.width - NAMES - 8));
    this.gather();
    this.draw();
  }

  time(x) {
    const { times, T } = this.capture;
    const span = times[T - 1] - times[0];
    return times[0] + Math.min(1, Math.max(0, (x - NAMES) / this.cells)) * span;
  }

  x(frame) {
    const { times, T } = this.capture;
    const span = times[T - 1] - times[0];
    return NAMES + (span > 0 ? (times[frame] - times[0]) / span : 0) * this.cells;
  }

  /** Compute the strips of some tracks again, which may be new ones. */
  renew(tracks) {
    const { capture, cells } = this;
    if (this.strips.length !== capture.K * cells) {
      const before = this.strips;
      this.strips = new Uint8Array(capture.K * cells);
      this.strips.set(before);
    }
    this.rows.style.height = `${RULER + ROW * this.order.length + 6}px`;
    this.gatherTracks(tracks);
  }

  /** Compute the worst frame of each track and cell. */
  gather() {
    const { capture, cells } = this;
    const { truth } = this.state.show;
    this.strips = new Uint8Array(capture.K * cells);
    this.missed = new Uint8Array(cells);
    if (!capture.T) return;
    const cell = new Uint32Array(capture.T);
    for (let t = 0; t < capture.T; t++) cell[t] = Math.min(cells - 1, this.x(t) - NAMES);
    this.cell = cell;
    this.gatherTracks(capture.starts.keys());
    for (let t = 0; t < capture.T && truth && capture.verdict; t++) {
      for (let i = capture.clutterStart[t]; i < capture.clutterStart[t + 1]; i++) {
        if (capture.verdict[i] === 2) this.missed[cell[t]] = 1;
      }
    }
  }

  gatherTracks(tracks) {
    const { capture, cells, cell } = this;
    const { truth } = this.state.show;
    for (const k of tracks) {
      if (k < 0 || k >= capture.K) continue;
      const strip = this.strips.subarray(k * cells, (k + 1) * cells);
      strip.fill(NONE);
      const worst = (i, value) => {
        if (strip[i] < value) strip[i] = value;
      };
      for (let r = capture.runsOf[k]; r < capture.runsOf[k + 1]; r++) {
        const first = capture.runFirst[r];
        const end = first + capture.runLength[r];
        for (let t = first; t < end; t++) {
          const point = capture.runStart[r] + t - first;
          let value = SURE;
          if (truth && capture.verdict?.[point] === 1) value = WRONG;
          else if (capture.confidence) value = doubt(capture.confidence[point]);
          // A short capture has several cells a frame.
          const stop = t + 1 < end ? cell[t + 1] : cell[Math.min(t + 1, capture.T - 1)];
          for (let i = cell[t]; i < Math.max(stop, cell[t] + 1); i++) worst(i, value);
        }
        if (r + 1 < capture.runsOf[k + 1]) {
          for (let i = cell[end - 1]; i < cell[capture.runFirst[r + 1]]; i++) worst(i, SPAN);
        }
      }
    }
  }

  draw() {
    const { capture, box, cells } = this;
    const pen = cleared(this.canvas, this.width, box.clientHeight);
    const top = box.scrollTop;
    const [sure, least] = [new Color(css("--sure")), new Color(css("--doubt"))];
    const levels = [...Array(LEVELS).keys()].map(
      (i) => `#${sure.clone().lerp(least, i / (LEVELS - 1)).getHexString()}`,
    );
    const colours = [null, css("--span"), ...levels, css("--wrong")];
    pen.font = FONT;
    pen.textBaseline = "middle";
    const first = Math.max(0, Math.floor((top - RULER) / ROW));
    const last = Math.min(this.order.length, Math.ceil((top + box.clientHeight) / ROW));
    for (let row = first; row < last; row++) {
      const k = this.order[row];
      const y = RULER + row * ROW - top;
      if (k === this.state.chosen) {
        pen.fillStyle = css("--chosen");
        pen.fillRect(0, y, this.width, ROW);
      }
      this.drawStrip(pen, this.strips.subarray(k * cells, (k + 1) * cells), y, colours);
      pen.fillStyle = css("--ink");
      pen.fillText(shortened(pen, capture.header.names[k], NAMES - 10), 4, y + ROW / 2 + 0.5);
    }
    this.drawRuler(pen);
    this.drawCursor(pen);
  }

  drawStrip(pen, strip, y, colours) {
    for (let i = 0; i < strip.length; ) {
      let j = i + 1;
      while (j < strip.length && strip[j] === strip[i]) j++;
      const value = strip[i];
      if (value !== NONE) {
        pen.fillStyle = colours[value];
        const thin = value === SPAN;
        pen.fillRect(NAMES + i, y + (thin ? ROW / 2 - 0.5 : 3), j - i, thin ? 1 : ROW - 6);
      }
      i = j;
    }
  }

  drawRuler(pen) {
    const { times, T } = this.capture;
    pen.fillStyle = css("--card");
    pen.fillRect(0, 0, this.width, RULER - 2);
    if (!T) return;
    pen.fillStyle = css("--missed");
    for (let i = 0; i < this.cells; i++) if (this.missed[i]) pen.fillRect(NAMES + i, RULER - 4, 1, 3);
    const span = times[T - 1] - times[0];
    const step = roundStep(span / Math.max(2, this.cells / 90));
    pen.fillStyle = css("--muted");
    pen.textAlign = "center";
    for (let s = Math.ceil(times[0] / step) * step; span > 0 && s <= times[T - 1] + 1e-9; s += step) {
      const x = NAMES + ((s - times[0]) / span) * this.cells;
      const text = `${+s.toFixed(6)} s`;
      const half = pen.measureText(text).width / 2;
      pen.fillText(text, Math.min(x, this.width - half - 2), 8);
      pen.fillRect(x, RULER - 5, 1, 4);
    }
    pen.textAlign = "left";
  }

  drawCursor(pen) {
    if (!this.capture.T) return;
    pen.fillStyle = css("--accent");
    pen.fillRect(this.x(this.state.frame) - 1, 0, 2, this.box.clientHeight);
  }

  click(event) {
    const y = event.offsetY + this.box.scrollTop - RULER;
    const track = this.order[Math.floor(y / ROW)];
    if (event.offsetY > RULER && track !== undefined) this.state.choose(track);
    if (event.offsetX >= NAMES - 4) this.state.seek(frameAt(this.capture.times, this.time(event.offsetX)));
  }

  key(event) {
    const step = { ArrowUp: -1, ArrowDown: 1 }[event.key];
    if (!step) return;
    event.preventDefault();
    this.step(step);
  }

  /** Select the track above or below the selected one. */
  step(step) {
    if (!this.order.length) return;
    const row = this.rowOf.get(this.state.chosen);
    const n = this.order.length;
    const next = row === undefined ? (step > 0 ? 0 : n - 1) : (row + step + n) % n;
    this.reveal(next);
    this.state.choose(this.order[next]);
  }

  reveal(row) {
    if (row === undefined) return;
    const y = RULER + row * ROW;
    if (y - RULER < this.box.scrollTop) this.box.scrollTop = y - RULER;
    const below = y + ROW - this.box.clientHeight;
    if (below > this.box.scrollTop) this.box.scrollTop = below;
  }
}

// Names of one segment often differ at their end alone, so the middle is left out.
function shortened(pen, text, room) {
  const without = (n) => `${text.slice(0, Math.floor(n / 3))}…${text.slice(Math.floor(n / 3) - n)}`;
  if (pen.measureText(text).width <= room) return text;
  let n = Math.min(text.length, 40);
  while (n > 2 && pen.measureText(without(n)).width > room) n--;
  return without(n);
}

function roundStep(size) {
  if (!(size > 0)) return 1;
  const ten = 10 ** Math.floor(Math.log10(size));
  return ten * [1, 2, 5, 10].find((m) => m * ten >= size * 0.999);
}
