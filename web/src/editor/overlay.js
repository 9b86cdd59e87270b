/** Canvas over the scene: the lasso, a selected point of clutter, and the preview of a fill. */

import { cleared } from "../flat.js";
import { css } from "../theme.js";
import { byId } from "./dom.js";

export class Overlay {
  constructor(stage, selection) {
    Object.assign(this, { stage, selection, path: null, fill: null });
    this.point = stage.point.clone();
    this.canvas = Object.assign(document.createElement("canvas"), { id: "overlay" });
    this.canvas.setAttribute("aria-hidden", "true");
    byId("names").after(this.canvas);
    const writes = stage.drawn;
    stage.drawn = () => {
      writes?.();
      this.draw();
    };
    this.connect(stage.canvas);
  }

  get isOn() {
    return !this.stage.controls.enabled;
  }

  /** Draw with the pointer around markers, and not turn the view. */
  lasso(on) {
    this.stage.controls.enabled = !on;
    this.stage.canvas.classList.toggle("lasso", on);
    byId("edit-lasso").setAttribute("aria-pressed", String(on));
    this.path = null;
    this.stage.redraw();
  }

  connect(canvas) {
    canvas.addEventListener("pointerdown", (event) => {
      if (!this.isOn) return;
      this.path = [[event.offsetX, event.offsetY]];
      try {
        canvas.setPointerCapture(event.pointerId);
      } catch {
        // The pointer may be gone already.
      }
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!this.path) return;
      this.path.push([event.offsetX, event.offsetY]);
      this.stage.redraw();
    });
    canvas.addEventListener("pointerup", () => {
      const { path } = this;
      this.path = null;
      if (path?.length > 3) {
        this.lasso(false);
        this.selection.choose(this.within(path));
      }
      this.stage.redraw();
    });
  }

  /** Tracks with a dot within a path. */
  within(path) {
    const { stage } = this;
    const found = [];
    for (let n = 0; n < stage.markers.count; n++) {
      const p = stage.onCanvas(stage.place(n, this.point));
      if (stage.markers.tracks[n] >= 0 && p.z <= 1 && isInside(p.x, p.y, path)) {
        found.push(stage.markers.tracks[n]);
      }
    }
    return found;
  }

  draw() {
    const { stage, selection } = this;
    const pen = cleared(this.canvas);
    pen.strokeStyle = pen.fillStyle = css("--accent");
    pen.lineWidth = 1.5;
    if (this.path) {
      pen.beginPath();
      for (const [x, y] of this.path) pen.lineTo(x, y);
      pen.stroke();
      pen.globalAlpha = 0.12;
      pen.fill();
      pen.globalAlpha = 1;
    }
    const { markers } = stage;
    for (let n = 0; n < markers.count && selection.point >= 0; n++) {
      const row = markers.points[n];
      if (row < 0 || selection.numbering.numberOf[row] !== selection.point) continue;
      const p = stage.onCanvas(stage.place(n, this.point));
      pen.beginPath();
      pen.arc(p.x, p.y, 8, 0, 2 * Math.PI);
      pen.stroke();
    }
    if (this.fill) this.drawFill(pen, this.fill);
  }

  /** The filled path, within a band of two standard deviations. */
  drawFill(pen, { points, sigma }) {
    const { stage } = this;
    const up = this.point.clone().set(0, 1, 0).applyQuaternion(stage.view.quaternion);
    const shown = points.map((place, n) => {
      const middle = stage.root.localToWorld(up.clone().set(place[0], place[1], place[2] ?? 0));
      const edge = middle.clone().addScaledVector(up, 2 * sigma[n]);
      const [p, q] = [stage.onCanvas(middle), stage.onCanvas(edge)];
      return { x: p.x, y: p.y, radius: Math.hypot(q.x - p.x, q.y - p.y) };
    });
    pen.globalAlpha = 0.22;
    pen.lineCap = pen.lineJoin = "round";
    pen.beginPath();
    shown.forEach(({ x, y, radius }, n) => {
      const before = shown[n - 1] ?? { x, y, radius };
      const steps = Math.max(1, Math.ceil(Math.hypot(x - before.x, y - before.y) / 3));
      for (let i = 1; i <= steps; i++) {
        const at = (a, b) => a + ((b - a) * i) / steps;
        const r = at(before.radius, radius);
        pen.moveTo(at(before.x, x) + r, at(before.y, y));
        pen.arc(at(before.x, x), at(before.y, y), r, 0, 2 * Math.PI);
      }
    });
    pen.fill();
    pen.globalAlpha = 1;
    pen.lineWidth = 2;
    pen.beginPath();
    for (const { x, y } of shown) pen.lineTo(x, y);
    pen.stroke();
  }
}

function isInside(x, y, path) {
  let inside = false;
  path.forEach(([x1, y1], n) => {
    const [x2, y2] = path[(n + 1) % path.length];
    if (y1 > y !== y2 > y && x < x1 + ((y - y1) / (y2 - y1)) * (x2 - x1)) inside = !inside;
  });
  return inside;
}
