/** Names of markers, on a 2-D canvas over the scene, where no name is interpreted as HTML. */

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
    this.drawAxes(pen, paper);
    for (const { text, place, chosen } of state.show.cameras ? stage.frustums.letters : []) {
      this.write(pen, text, this.at(place), chosen ? css("--accent") : muted, paper, 6);
    }
    const taken = [];
    const name = (n, font, colour, mustBe) => {
      const p = stage.onCanvas(stage.place(n, this.point));
      const text = capture.header.names[markers.tracks[n]];
      pen.font = font;
      const [x, width] = [p.x, pen.measureText(text).width + 10];
      const covers = (o) => Math.abs(o.y - p.y) < 12 && o.x < x + width && x < o.x + o.width;
      // Overlapping names are unreadable.
      if (!mustBe && taken.some(covers)) return;
      for (let n = 0; n < 8 && taken.some(covers); n++) p.y += 13;
      taken.push({ x, y: p.y, width });
      this.write(pen, text, p, colour, paper, 10);
    };
    const dots = [...markers.tracks.subarray(0, markers.count).keys()];
    const isMarked = (k) =>
      k >= 0 && (k === state.chosen || k === state.hovered || state.involved.includes(k));
    for (const n of dots) if (isMarked(markers.tracks[n])) name(n, `600 ${FONT}`, ink, true);
    if (!state.show.names) return;
    const others = dots.filter((n) => markers.tracks[n] >= 0 && !isMarked(markers.tracks[n]));
    for (const n of others.slice(0, MOST_NAMES)) name(n, FONT, muted, false);
  }

  /** Directions of the axes of the capture, in a corner of the scene. */
  drawAxes(pen, paper) {
    const { root, view, capture, canvas } = this.stage;
    const turned = view.quaternion.clone().invert().multiply(root.quaternion);
    const [x, y] = [canvas.clientWidth - 48, 50];
    const arrows = ["--x", "--y", "--z"].slice(0, capture.axes).map((name, i) => {
      const way = new Vector3().setComponent(i, 1).applyQuaternion(turned);
      return { way, text: "xyz"[i], colour: css(name) };
    });
    arrows.sort((a, b) => a.way.z - b.way.z);
    pen.lineWidth = 2;
    for (const { way, text, colour } of arrows) {
      pen.strokeStyle = colour;
      pen.beginPath();
      pen.moveTo(x, y);
      pen.lineTo(x + 28 * way.x, y - 28 * way.y);
      pen.stroke();
      this.write(pen, text, { x: x + 38 * way.x - 3, y: y - 38 * way.y, z: 0 }, colour, paper, 0);
      pen.lineWidth = 2;
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
