/** Details of the selected marker in the current frame. */

import { ABSENT, GAP, Places } from "./places.js";

export class Details {
  constructor(capture, state, { box, list, follow }) {
    Object.assign(this, { capture, state, box, list, follow });
    this.places = new Places(capture);
    this.rows = new Map();
    this.against = capture.header.against === "truth" ? "True marker" : "Other result";
  }

  draw() {
    const { capture, state } = this;
    const k = state.chosen;
    this.box.hidden = k < 0;
    this.follow.checked = state.follow;
    if (k < 0) return;
    const place = [0, 0, 0];
    const there = this.places.find(k, state.frame, place, 0);
    const point = this.places.point;
    this.row("Name", capture.header.names[k]);
    this.row("Track", `${k}, ${capture.starts[k + 1] - capture.starts[k]} points`);
    this.row("State", this.seen(there, point));
    const shown = place.slice(0, capture.axes).map((x) => (1000 * x).toFixed(1));
    this.row("Position, mm", there === ABSENT ? "–" : shown.join(", "));
    if (capture.confidence) {
      this.row(capture.header.confidence, point < 0 ? "–" : percent(capture.confidence[point]));
    }
    if (capture.marker) this.row(this.against, this.trueMarker(point));
  }

  seen(there, point) {
    if (there === ABSENT) return "absent";
    if (there === GAP) return "occluded, position interpolated";
    if (this.capture.filled?.[point]) return "filled, not measured";
    return "detected";
  }

  trueMarker(point) {
    const { marker, verdict, header } = this.capture;
    if (point < 0) return "–";
    const m = marker[point];
    const name = m < 0 ? "no marker" : header.markers[m] ?? `marker ${m}`;
    return verdict[point] === 1 ? `${name}: ${header.against === "truth" ? "wrong" : "differs"}` : name;
  }

  row(name, text) {
    if (!this.rows.has(name)) {
      const [pair, term, value] = ["div", "dt", "dd"].map((tag) => document.createElement(tag));
      term.textContent = name;
      value.dataset.about = name.split(",")[0].toLowerCase();
      pair.append(term, value);
      this.list.append(pair);
      this.rows.set(name, value);
    }
    const value = this.rows.get(name);
    if (value.textContent !== text) value.textContent = text;
  }
}

function percent(c) {
  if (c >= 254) return "over 99 %";
  return `${Math.round((100 * c) / 255)} %`;
}
