/** Names in the scene, on a flat canvas over it: text there is never taken for HTML. */

import { Vector3 } from "three";

import { cleared, FONT } from "./flat.js";
import { css } from "./theme.js";

const MOST_NAMES = 250;

export class Writing {
  constructor(stage, canvas) {
    this.stage = stage;
    this.canvas = canvas;
    this.point = new Vector3();
  }

  draw() {
    const { stage } = this;
    const { state, markers, capture } = stage;
    const pen = cleared(this.canvas);
    pen.font = FONT;
    pen.textBaseline = "middle";
    pen.lineJoin = "round";
    const paper = css("--stage");
    const ink = css("--ink");
    const muted = css("--muted");
    for (const { text, place, colour } of stage.floor.letters) {
      this.write(pen, text, this.at(place), colour, paper, 0);
    }
    for (const { text, place, chosen } of state.show.cameras ? stage.frustums.letters : []) {
      this.write(pen, text, this.at(place), chosen ? css("--accent") : muted, paper, 6);
    }
    let left = MOST_NAMES;
    for (let n = 0; n < markers.count; n++) {
      const k = markers.tracks[n];
      const isMarked = k >= 0 && (k === state.chosen || k === state.hovered);
      if (k < 0 || !(isMarked || (state.show.names && left-- > 0))) continue;
      const p = stage.onCanvas(stage.place(n, this.point));
      pen.font = isMarked ? `600 ${FONT}` : FONT;
      this.write(pen, capture.header.names[k], p, isMarked ? ink : muted, paper, 10);
    }
  }

  at(place) {
    return this.stage.onCanvas(this.stage.root.localToWorld(this.point.copy(place)));
  }

  write(pen, text, p, colour, paper, right) {
    if (p.z > 1) return;
    pen.strokeStyle = paper;
    pen.lineWidth = 3;
    pen.strokeText(text, p.x + right, p.y);
    pen.fillStyle = colour;
    pen.fillText(text, p.x + right, p.y);
  }
}
