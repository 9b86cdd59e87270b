/** Health of a stream: its figures, the histogram of latencies, and what went wrong. */

import { cleared, FONT } from "../flat.js";
import { css } from "../theme.js";

const byId = (id) => document.getElementById(id);
const TICKS = [1e-4, 1e-3, 1e-2, 1e-1, 1];
const MARKS = [["median", "median"], ["p99", "99 %"], ["p999", "99.9 %"]];

export class Health {
  constructor() {
    this.health = null;
  }

  /** Show the figures that the server reports twice a second. */
  take(health) {
    this.health = health;
    const { info, faults } = health;
    byId("rate").textContent = info.rate ? `${info.rate.toFixed(1)} Hz` : "–";
    byId("tracks").textContent = info.tracks;
    byId("named").textContent = info.names;
    byId("latency").textContent = seconds(info.latency_median);
    byId("model").textContent = info.models ? `${info.models}` : "being estimated";
    byId("drift").textContent = info.drift === null ? "–" : `${(1e6 * info.drift).toFixed(0)} ppm`;
    const list = byId("faults");
    list.replaceChildren(...faults.map(([what, n]) => {
      const row = document.createElement("li");
      const name = Object.assign(document.createElement("bdi"), { textContent: what });
      const count = document.createElement("b");
      count.textContent = n.toLocaleString("en");
      row.append(name, count);
      return row;
    }));
    byId("no-faults").hidden = faults.length > 0;
    this.draw();
  }

  draw() {
    if (!this.health) return;
    const { classes, info } = this.health;
    const canvas = byId("histogram");
    const pen = cleared(canvas);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    const base = height - 20;
    const x = (s) => ((Math.log10(s) + 4.3) / 4.6) * width;
    const most = Math.max(1, ...classes.map(([, n]) => n));
    pen.fillStyle = css("--sure");
    for (const [end, n] of classes) {
      // On a root scale, so that single late frames are visible.
      const tall = Math.max(1.5, Math.sqrt(n / most) * (base - 22));
      pen.fillRect(x(end / 10 ** (1 / 40)), base - tall, Math.max(1, x(10 ** (1 / 40)) - x(1) - 0.5), tall);
    }
    pen.font = FONT;
    pen.textBaseline = "middle";
    pen.textAlign = "center";
    pen.fillStyle = css("--muted");
    pen.fillRect(0, base, width, 1);
    for (const s of TICKS) pen.fillText(seconds(s), Math.min(width - 16, Math.max(18, x(s))), height - 8);
    MARKS.forEach(([name], i) => {
      const s = info[`latency_${name}`];
      if (s === null) return;
      pen.fillStyle = css(i ? "--doubt" : "--ink");
      pen.fillRect(x(s), 14, 1.5, base - 14);
    });
    byId("quantiles").textContent = MARKS.map(
      ([name, text]) => `${text} ${seconds(info[`latency_${name}`])}`.replaceAll(" ", "\u00a0"),
    ).join(" · ");
  }
}

function seconds(s) {
  if (s === null || s === undefined) return "–";
  if (s >= 1) return `${+s.toPrecision(3)} s`;
  return s < 1e-3 ? `${+(1e3 * s).toPrecision(2)} ms` : `${+(1e3 * s).toPrecision(3)} ms`;
}
