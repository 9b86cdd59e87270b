/** What is selected: one or two tracks, those of a lasso, or a point of clutter. */

import { byId, named } from "./dom.js";

export class Selection {
  constructor({ state, stage, capture }, numbering) {
    Object.assign(this, { state, stage, capture, numbering });
    this.tracks = [];
    this.kept = -1; // track that stays selected beside the next one
    this.point = -1; // number of a detection of clutter
    this.last = -1;
    state.addEventListener("change", () => this.follow());
    if (stage) this.connect(stage.canvas);
  }

  connect(canvas) {
    let down = null;
    canvas.addEventListener("pointerdown", (event) => {
      down = [event.offsetX, event.offsetY];
      if (event.shiftKey) this.keep();
    }, true);
    canvas.addEventListener("pointerup", (event) => {
      if (!down || !this.stage.controls.enabled) return;
      if (Math.hypot(event.offsetX - down[0], event.offsetY - down[1]) >= 5) return;
      const [x, y] = [event.offsetX, event.offsetY];
      if (this.stage.pick(x, y) >= 0) return;
      const n = this.stage.dotAt(x, y, (track) => track < 0);
      if (n >= 0) this.choosePoint(this.numbering.numberOf[this.stage.markers.points[n]]);
    });
  }

  /** Follow the selected track of the player. */
  follow() {
    const { chosen } = this.state;
    if (chosen !== this.last) {
      this.last = chosen;
      if (chosen >= 0 && this.kept >= 0 && this.kept !== chosen) this.tracks = [this.kept, chosen];
      else if (chosen < 0) this.tracks = this.point >= 0 && this.kept >= 0 ? [this.kept] : [];
      else if (!this.tracks.includes(chosen)) this.tracks = [chosen];
      if (chosen >= 0) this.point = -1;
      if (chosen >= 0 && this.kept !== chosen) this.kept = -1;
    }
    if (this.point >= 0 && this.numbering.frame[this.point] !== this.state.frame) this.point = -1;
    this.draw();
  }

  /** Keep the selected track, so that the next one is selected beside it. */
  keep() {
    this.kept = this.state.chosen;
    this.draw();
  }

  /** Select tracks together; the first one is that of the player. */
  choose(tracks) {
    this.kept = this.point = -1;
    this.tracks = tracks;
    this.last = tracks[0] ?? -1;
    this.state.involved = tracks;
    this.state.choose(this.last);
  }

  choosePoint(number) {
    this.point = number;
    this.tracks = this.kept >= 0 ? [this.kept] : [];
    this.last = -1;
    this.state.choose(-1);
  }

  /** Select the next point of clutter in this frame. */
  stepPoint() {
    const { offsets, label } = this.numbering;
    const t = this.state.frame;
    const own = [];
    for (let i = offsets[t]; i < offsets[t + 1]; i++) if (label[i] === -1) own.push(i);
    if (own.length) this.choosePoint(own[(own.indexOf(this.point) + 1) % own.length]);
  }

  draw() {
    const names = this.tracks.map((k) => this.capture.header.names[k]);
    const parts = names.slice(0, 4).flatMap((name, n) => [n ? ", " : "", named(name)]);
    if (names.length > 4) parts.push(` and ${names.length - 4} more`);
    if (this.point >= 0) parts.push(parts.length ? " and a point of clutter" : "a point of clutter");
    if (this.kept >= 0 && this.point < 0) parts.push(": select a second one");
    if (!parts.length) parts.push("Select a marker to correct it.");
    else parts.unshift("Selected: ");
    byId("selection").replaceChildren(...parts);
    const [n, hasPoint] = [this.tracks.length, this.point >= 0];
    const can = {
      swap: n === 2, join: n === 2 || (n === 1 && hasPoint), apart: n === 1 || n === 2, cut: n === 1, "cut-back": n === 1,
      "cut-whole": n === 1, ghost: n >= 1, fill: n === 1, open: n === 1, keep: n === 1 && this.kept < 0,
      give: n === 1 || hasPoint,
    };
    for (const [name, is] of Object.entries(can)) byId(`edit-${name}`).disabled = !is;
  }
}
