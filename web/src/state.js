/** State of the page: frame, selection and options; listeners are called at each change. */

import { frameAt } from "./places.js";

export class State extends EventTarget {
  /** @param {import("./unpack.js").Capture} capture */
  constructor(capture) {
    super();
    this.capture = capture;
    this.frame = capture.header.opens;
    this.chosen = -1;
    this.involved = []; // tracks of the place that is visited
    this.hovered = -1;
    this.follow = false;
    this.moves = true; // with the subject
    this.playing = false;
    this.speed = 1;
    this.camera = 0;
    this.show = { names: false, lines: true, clutter: true, cameras: true, trails: 0.5,
      truth: true, colours: "track" };
    this.clock = capture.times[this.frame] ?? 0; // time of the player in seconds; it may lie between frames
    this.before = null;
  }

  /** Call all listeners, which draw again. */
  changed() {
    this.dispatchEvent(new Event("change"));
  }

  seek(frame) {
    const last = Math.max(0, this.capture.T - 1);
    this.frame = Math.min(last, Math.max(0, Math.round(frame)));
    this.clock = this.capture.times[this.frame] ?? 0;
    this.changed();
  }

  choose(track) {
    this.chosen = track;
    if (!this.involved.includes(track)) this.involved = [];
    if (track < 0) this.follow = false;
    this.changed();
  }

  set(changes) {
    Object.assign(this, changes);
    this.changed();
  }

  play(on) {
    if (on && this.frame >= this.capture.T - 1) this.seek(0);
    this.playing = on && this.capture.T > 1;
    this.before = null;
    this.changed();
    if (this.playing) requestAnimationFrame((now) => this.tick(now));
  }

  tick(now) {
    if (!this.playing) return;
    const { times, T } = this.capture;
    if (this.before !== null) this.clock += ((now - this.before) / 1000) * this.speed;
    this.before = now;
    const frame = frameAt(times, this.clock);
    if (frame !== this.frame) {
      this.frame = frame;
      this.changed();
    }
    if (frame >= T - 1) this.play(false);
    else requestAnimationFrame((next) => this.tick(next));
  }
}
