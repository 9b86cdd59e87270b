/** The player of a page: of a report, whose data it unpacks, or of a stream. */

import "./style.css";

import { hueOf } from "./colours.js";
import { connect, connectPointer } from "./controls.js";
import { Details } from "./details.js";
import { CameraImage } from "./image.js";
import { live } from "./live/main.js";
import { Stage } from "./stage.js";
import { State } from "./state.js";
import { onTheme } from "./theme.js";
import { Timeline } from "./timeline.js";
import { unpack } from "./unpack.js";
import { Writing } from "./writing.js";

const byId = (id) => document.getElementById(id);

async function start() {
  const message = byId("state");
  let capture;
  try {
    capture = await unpack(byId("data").textContent);
  } catch (error) {
    message.textContent = "This browser cannot decompress the data of the page. Use a browser of 2023 or newer.";
    throw error;
  }
  byId("data").remove();
  const state = new State(capture);
  const stage = staged(capture, state, message);
  const writing = stage && new Writing(stage, byId("names"));
  if (stage) stage.drawn = () => writing.draw();
  const timeline = new Timeline(capture, state, {
    box: byId("timeline"), canvas: byId("strips"), rows: byId("rows"),
  });
  const details = new Details(capture, state, {
    box: byId("about"), list: byId("chosen"), follow: byId("follow"),
  });
  const image = byId("image")
    ? new CameraImage(capture, state, byId("image"), byId("image-count"))
    : null;
  const keys = connect({ capture, state, stage, timeline });
  if (stage) connectPointer(stage, state);

  function draw() {
    const began = performance.now();
    tell(capture, state);
    stage?.update();
    details.draw();
    timeline.draw();
    image?.draw();
    document.body.dataset.drawn = (performance.now() - began).toFixed(1);
  }
  function resize() {
    stage?.resize();
    timeline.resize();
    draw();
  }
  state.addEventListener("change", draw);
  new ResizeObserver(resize).observe(byId("player"));
  onTheme(() => {
    stage?.drawFloor();
    draw();
  });
  resize();
  stage?.fitSubject();
  if (stage) byId("scale").textContent = `squares of ${size(stage.floor.cell)}`;
  if (stage && capture.T && capture.positions.length) message.hidden = true;
  else if (stage) message.textContent = capture.T ? "The capture has no points." : "The capture has no frames.";
  globalThis.asterism = script(capture, state, stage, image);
  dispatchEvent(new CustomEvent("player", { detail: { capture, state, stage, timeline, keys, draw } }));
  document.body.dataset.ready = "true";
}

/** Make the scene, or show why there is none. The rest of the page works without it. */
function staged(capture, state, message) {
  try {
    return new Stage(capture, state, byId("scene"));
  } catch (error) {
    message.textContent = "This browser has no WebGL, so the 3-D view is absent.";
    console.info(error.message);
    return null;
  }
}

/** Show frame and time. */
function tell(capture, state) {
  const slider = byId("frame");
  slider.value = state.frame;
  const time = capture.T ? capture.times[state.frame].toFixed(3) : "";
  const number = capture.frames[state.frame];
  byId("clock").textContent = capture.T ? `${time} s · frame ${number}` : "no frame";
  slider.setAttribute("aria-valuetext", `frame ${number}, ${time} seconds`);
  const play = byId("play");
  play.textContent = state.playing ? "❚❚" : "▶";
  play.setAttribute("aria-label", state.playing ? "Pause" : "Play");
}

function size(metres) {
  if (metres < 0.01) return `${+(1000 * metres).toPrecision(3)} mm`;
  return metres < 1 ? `${+(100 * metres).toPrecision(3)} cm` : `${+metres.toPrecision(3)} m`;
}

/** Commands for the console of the browser: `asterism.seek(120)`. */
function script(capture, state, stage, image) {
  return {
    capture,
    state: () => ({
      frame: state.frame, chosen: state.chosen, playing: state.playing, speed: state.speed,
      follow: state.follow, moves: state.moves, involved: state.involved,
    }),
    seek: (frame) => state.seek(frame),
    choose: (track) => state.choose(track),
    /** Index of the colour of a track, -1 for none of the cycle. */
    hue: (track) => hueOf(capture, state.show, track),
    /** Position of a track on the canvas in CSS pixels, null without one. */
    where: (track) => {
      const n = stage ? stage.dotOf(track) : -1;
      if (n < 0) return null;
      const p = stage.onCanvas(stage.place(n, stage.point));
      return [p.x, p.y];
    },
    /** Position of a track in the image of the selected camera in pixels, null without one. */
    pixel: (track) => image?.pixelOf(track) ?? null,
  };
}

const stream = byId("live");
if (stream) live(stream);
else start();
