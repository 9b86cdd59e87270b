/** The player of a stream: the stage of the report, with the frames that arrive. */

import { connectPointer } from "../controls.js";
import { Stage } from "../stage.js";
import { State } from "../state.js";
import { onTheme } from "../theme.js";
import { Writing } from "../writing.js";
import { LiveCapture } from "./capture.js";
import { Health } from "./health.js";
import { listen } from "./source.js";
import { LiveTrails } from "./trails.js";

const byId = (id) => document.getElementById(id);
const STALE_MS = 1000; // without a frame

/** @param {HTMLElement} block the element with the header */
export function live(block) {
  const message = byId("state");
  const capture = new LiveCapture(JSON.parse(block.textContent));
  const state = new State(capture);
  const health = new Health();
  let stage;
  try {
    // Without a graphics card, smoothed edges take half of the time of a frame.
    stage = new Stage(capture, state, byId("scene"), false);
  } catch (error) {
    message.textContent = "This browser has no WebGL, so the 3-D view is absent.";
    console.info(error.message);
  }
  const writing = stage && new Writing(stage, byId("names"));
  if (stage) {
    stage.drawn = () => writing.draw();
    trailed(stage, capture);
    connectPointer(stage, state);
  }
  let [arrived, isNew, isFitted, names] = [-Infinity, false, false, {}];
  let [drawn, began] = [0, performance.now()];

  function take(line) {
    if (line.health) return health.take(line.health);
    if (line.names) {
      names = line.names;
      capture.rename(names);
      return undefined;
    }
    if (capture.take(line) && stage) {
      stage.grow();
      trailed(stage, capture);
    }
    if (line.ids.some((id) => names[id])) capture.rename(names);
    stage?.trails.keep();
    arrived = performance.now();
    isNew = true;
    return undefined;
  }

  function fit() {
    const [low, high] = capture.box();
    if (!stage || low[0] > high[0]) return;
    isFitted = true;
    capture.header.box = [low, high];
    stage.drawFloor();
    const { cell } = stage.floor;
    byId("scale").textContent = `squares of ${cell < 1 ? `${+(100 * cell).toPrecision(3)} c` : `${cell} `}m`;
    const middle = [...capture.course];
    capture.header.subject = [0, 1, 2, 3, 4, 5, 6, 7].map((n) =>
      low.map((l, i) => ((n >> i) & 1 ? high[i] : l) - middle[i]),
    );
    if (byId("follow").checked) stage.fitSubject();
    else stage.fit();
  }

  function draw() {
    requestAnimationFrame(draw);
    const now = performance.now();
    const isStale = now - arrived > STALE_MS;
    message.hidden = !isStale && isFitted;
    if (isStale) message.textContent = "Waiting for frames …";
    if (isNew) {
      isNew = false;
      if (!isFitted && capture.slots.size) fit();
      byId("clock").textContent = `${capture.times[0].toFixed(2)} s · frame ${capture.frames[0]}`;
      stage?.update();
      drawn++;
    }
    if (now - began > 1000) {
      document.body.dataset.fps = ((1000 * drawn) / (now - began)).toFixed(1);
      [drawn, began] = [0, now];
    }
  }

  state.addEventListener("change", () => stage?.update());
  byId("show-names").addEventListener("change", (e) => show({ names: e.target.checked }));
  byId("show-clutter").addEventListener("change", (e) => show({ clutter: e.target.checked }));
  byId("trails").addEventListener("change", (e) => show({ trails: Number(e.target.value) }));
  byId("up").addEventListener("change", (e) => {
    stage?.setUp(e.target.value);
    fit();
  });
  byId("follow").addEventListener("change", (e) => state.set({ moves: e.target.checked }));
  byId("fit").addEventListener("click", fit);
  function show(changes) {
    Object.assign(state.show, changes);
    state.changed();
  }
  new ResizeObserver(() => {
    stage?.resize();
    stage?.update();
    health.draw();
  }).observe(byId("player"));
  onTheme(() => {
    stage?.drawFloor();
    stage?.update();
    health.draw();
  });
  stage?.resize();
  listen(take, () => {
    arrived = -Infinity;
  });
  draw();
  document.body.dataset.ready = "true";
  globalThis.asterism = { capture, state: () => state, health };
}

/** Put trails from a ring of frames in the place of those of a capture. */
function trailed(stage, capture) {
  const old = stage.trails.object;
  stage.root.remove(old);
  old.geometry.dispose();
  old.material.dispose();
  stage.trails = new LiveTrails(capture);
  stage.root.add(stage.trails.object);
}
