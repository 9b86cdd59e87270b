/** Corrections by hand, each as one or two edits about detections. */

export class Corrections {
  constructor({ state, capture }, numbering, selection) {
    Object.assign(this, { state, capture, numbering, selection, marked: -1 });
  }

  get track() {
    const { tracks } = this.selection;
    if (!tracks.length) throw new Error("Select a track first.");
    return tracks[0];
  }

  pair() {
    const { tracks } = this.selection;
    if (tracks.length !== 2) throw new Error("Select two tracks first: E keeps the first one.");
    return tracks;
  }

  /** Exchange two tracks from this frame on: the one after is the other before. */
  swap() {
    const [a, b] = this.pair();
    for (const [one, other] of [[a, b], [b, a]]) {
      const before = this.numbering.before(one, this.state.frame);
      const after = this.numbering.from(other, this.state.frame);
      if (before >= 0 && after >= 0) return [edit("same", before, after)];
    }
    throw new Error("Both tracks are on one side of this frame: join them instead.");
  }

  /** Exchange two tracks in this frame alone, or from the marked frame to this one. */
  here() {
    const { numbering, selection, state, marked } = this;
    const t = state.frame;
    if (selection.point >= 0) {
      const near = numbering.nearest(this.track, t, t);
      if (near < 0) throw new Error("The track has no other detection.");
      return [edit("only", near, selection.point)];
    }
    const [low, high] = [Math.min(marked < 0 ? t : marked, t), Math.max(marked, t)];
    const [a, b] = this.pair();
    for (const [one, other] of [[a, b], [b, a]]) {
      const [first, last] = [numbering.from(other, low), numbering.before(other, high + 1)];
      const earlier = numbering.before(one, low);
      const anchor = earlier >= 0 ? earlier : numbering.from(one, high + 1);
      if (first < 0 || anchor < 0 || numbering.frame[first] > high) continue;
      this.marked = -1;
      return [edit("only", anchor, ...new Set([first, last]))];
    }
    throw new Error("Neither track has a detection there and one outside.");
  }

  /** Mark this frame, or take the mark away. */
  mark() {
    this.marked = this.marked === this.state.frame ? -1 : this.state.frame;
    return this.marked;
  }

  /** Two tracks are one marker, or a point of clutter is of a track. */
  join() {
    const { numbering, selection, capture } = this;
    if (selection.point >= 0) {
      const t = numbering.frame[selection.point];
      const near = numbering.nearest(this.track, t, t);
      if (near < 0) throw new Error("The track has no other detection.");
      return [edit("same", near, selection.point)];
    }
    const pair = this.pair();
    const ends = pair.map((k) => [numbering.from(k, 0), numbering.before(k, capture.T)]);
    const frame = (i) => numbering.frame[i];
    for (const [first, second] of [[0, 1], [1, 0]]) {
      const [end, begin] = [ends[first][1], ends[second][0]];
      if (frame(end) < frame(begin)) return [edit("same", end, begin)];
    }
    const one = numbering.nearest(pair[0], this.state.frame);
    const other = numbering.nearest(pair[1], this.state.frame, frame(one));
    if (frame(one) === frame(other)) throw new Error("Both have a detection in this frame only.");
    return [edit("same", one, other)];
  }

  /**
   * Two tracks are different markers, as are a point of clutter and a track, or a track at the
   * marked frame and at this one.
   */
  apart() {
    const { numbering, selection, state, marked, track } = this;
    const t = state.frame;
    if (selection.point >= 0) return [edit("different", numbering.nearest(track, t), selection.point)];
    if (selection.tracks.length > 1) {
      return [edit("different", ...this.pair().map((k) => numbering.nearest(k, t)))];
    }
    if (marked < 0) throw new Error("Select two tracks, or mark another frame of the track: Shift H.");
    const [one, other] = [numbering.nearest(track, marked), numbering.nearest(track, t)];
    if (one === other) throw new Error("The track has the same detection at the marked frame and here.");
    this.marked = -1;
    return [edit("different", one, other)];
  }

  /** The track goes on as another marker from this frame on, or was one up to this frame. */
  cut(isBack) {
    const t = this.state.frame + (isBack ? 1 : 0);
    const [before, after] = [this.numbering.before(this.track, t), this.numbering.from(this.track, t)];
    if (before < 0 || after < 0) throw new Error("The track begins or ends at this frame.");
    return [edit("cut", before, after)];
  }

  /** The part without gaps at this frame is of another marker. */
  cutWhole() {
    const { capture, numbering, track } = this;
    const here = numbering.nearest(track, this.state.frame);
    let r = capture.runsOf[track];
    while (capture.runFirst[r] + capture.runLength[r] <= numbering.frame[here]) r += 1;
    const [first, end] = [capture.runFirst[r], capture.runFirst[r] + capture.runLength[r]];
    const found = [];
    for (const t of [first, end]) {
      const [before, after] = [numbering.before(track, t), numbering.from(track, t)];
      if (before >= 0 && after >= 0) found.push(edit("cut", before, after));
    }
    if (!found.length) throw new Error("The track has no gap: there is nothing to cut out of.");
    return found;
  }

  ghost() {
    if (!this.selection.tracks.length) throw new Error("Select a track first.");
    return this.selection.tracks.map((k) =>
      edit("clutter", this.numbering.nearest(k, this.state.frame)),
    );
  }

  name(name) {
    const { selection, numbering } = this;
    const i = selection.point >= 0 ? selection.point : numbering.nearest(this.track, this.state.frame);
    return [{ kind: "name", detections: [i], name }];
  }

  /** Gap of the selected track at this frame or after it, as frames of the page. */
  gap() {
    const { numbering, track } = this;
    const { T } = this.capture;
    let t = this.state.frame;
    const frame = (i) => numbering.frame[i];
    for (;;) {
      const after = numbering.from(track, t);
      if (after < 0) throw new Error("The track has no gap from this frame on.");
      const before = numbering.before(track, frame(after));
      if (before >= 0 && frame(after) - frame(before) > 1) {
        return { track, first: frame(before) + 1, last: frame(after) - 1 };
      }
      t = frame(after) + 1;
      if (t >= T) throw new Error("The track has no gap from this frame on.");
    }
  }
}

function edit(kind, ...detections) {
  return { kind, detections, name: "" };
}
