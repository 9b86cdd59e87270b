/** The 3-D scene: markers, lines and surroundings, with a view that the reader turns. */

import {
  ColorManagement, Group, LinearSRGBColorSpace, MOUSE, PerspectiveCamera, Quaternion, Scene,
  TOUCH, Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

import { Connections, Trails } from "./lines.js";
import { Markers } from "./markers.js";
import { frameAt, Places, SEEN } from "./places.js";
import { Floor, Frustums } from "./surroundings.js";
import { ink, accent } from "./theme.js";

// Without colour management, so that colours equal those of the figures.
ColorManagement.enabled = false;

const UP = { x: new Vector3(1, 0, 0), y: new Vector3(0, 1, 0), z: new Vector3(0, 0, 1) };
const SEEN_FROM = new Vector3(0.6, 0.33, 0.9).normalize();
const AROUND = 0.25; // seconds about a place that are framed
const CONTEXT = 24; // smallest half size of a frame, in radii of a marker
// What the view follows, beside tracks by their number.
const [NOTHING, SUBJECT] = [-1, -2];
const NEAR_PX = 16; // largest distance of a click from the dot that it selects

export class Stage {
  /**
   * @param {import("./unpack.js").Capture} capture
   * @param {import("./state.js").State} state
   * @param {HTMLCanvasElement} canvas
   * @param {boolean} antialias whether the edges of lines are smoothed
   */
  constructor(capture, state, canvas, antialias = true) {
    this.capture = capture;
    this.state = state;
    this.canvas = canvas;
    this.renderer = new WebGLRenderer({ canvas, antialias, alpha: true });
    this.renderer.outputColorSpace = LinearSRGBColorSpace;
    this.renderer.setClearColor(0, 0);
    this.scene = new Scene();
    this.root = new Group(); // rotates the vertical axis of the capture to that of the scene
    this.scene.add(this.root);
    this.view = new PerspectiveCamera(capture.axes === 2 ? 20 : 38, 1, 0.01, 1000);
    const places = new Places(capture);
    this.places = places;
    const [low, high] = capture.header.box;
    this.size = Math.max(0.05, Math.hypot(...high.map((h, i) => h - low[i])));
    this.floor = new Floor(capture);
    this.trails = new Trails(capture, places);
    this.lines = new Connections(capture, places);
    this.frustums = new Frustums(capture, this.size);
    this.markers = new Markers(capture, places);
    for (const part of [this.floor, this.frustums, this.lines, this.trails, this.markers]) {
      this.root.add(part.object);
    }
    this.markers.uniforms.radius.value = Math.max(capture.header.radius, 0.002 * this.size);
    this.controls = new OrbitControls(this.view, canvas);
    this.controls.enableDamping = false;
    if (capture.axes === 2) {
      this.controls.enableRotate = false;
      this.controls.mouseButtons.LEFT = MOUSE.PAN;
      this.controls.touches.ONE = TOUCH.PAN;
    }
    this.controls.screenSpacePanning = true;
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("change", () => this.redraw());
    this.followed = new Vector3();
    this.following = NOTHING;
    this.point = new Vector3();
    this.setUp(capture.header.up);
  }

  /** Make room for more tracks and clutter than before. */
  grow() {
    const { capture, places } = this;
    for (const [name, made] of [
      ["markers", new Markers(capture, places)], ["trails", new Trails(capture, places)],
    ]) {
      const old = this[name].object;
      this.root.remove(old);
      old.geometry.dispose();
      old.material.dispose();
      this[name] = made;
      this.root.add(made.object);
    }
    this.markers.uniforms.radius.value = Math.max(capture.header.radius, 0.002 * this.size);
    this.resize();
  }

  setUp(axis) {
    this.up = this.capture.axes === 2 ? "z" : axis;
    const to = this.capture.axes === 2 ? UP.z : UP.y;
    this.root.quaternion.copy(new Quaternion().setFromUnitVectors(UP[this.up], to));
    this.root.updateMatrixWorld();
    this.drawFloor();
  }

  drawFloor() {
    this.floor.draw(this.up, ink());
  }

  /** Show the whole scene. */
  fit() {
    this.state.set({ moves: false });
    this.show(corners(...this.capture.header.box), this.front());
  }

  /** Show the subject where it is, and move with it. */
  fitSubject() {
    this.state.set({ moves: true });
    const here = this.courseAt(this.state.frame);
    this.show(this.capture.header.subject.map((p) => p.map((x, i) => x + here[i])), this.front());
  }

  front() {
    return this.capture.axes === 2 ? UP.z : SEEN_FROM;
  }

  /** Place of the subject in a frame. */
  courseAt(frame) {
    const { course, T } = this.capture;
    const n = course.length / 3;
    const at = T > 1 ? (frame / (T - 1)) * (n - 1) : 0;
    const before = Math.min(Math.floor(at), Math.max(0, n - 2));
    const after = Math.min(before + 1, n - 1);
    return [0, 1, 2].map((i) => {
      const x = course[3 * before + i];
      return x + (at - before) * (course[3 * after + i] - x);
    });
  }

  /** Show points of the capture from a direction, in the middle of the view. */
  show(points, from) {
    const places = points.map((p) => this.root.localToWorld(new Vector3(...p)));
    this.view.position.copy(from);
    this.view.lookAt(0, 0, 0);
    const middle = new Vector3();
    let size = 0.05;
    for (const axis of [UP.x, UP.y, UP.z]) {
      const way = axis.clone().applyQuaternion(this.view.quaternion);
      const along = places.map((p) => p.dot(way));
      const [low, high] = [Math.min(...along), Math.max(...along)];
      middle.addScaledVector(way, (low + high) / 2);
      size = Math.max(size, high - low);
    }
    this.controls.target.copy(middle);
    let [near, away] = [0.3 * size, 20 * size];
    for (let n = 0; n < 20; n++) {
      const tried = (near + away) / 2;
      if (this.holds(places, middle, from, tried)) away = tried;
      else near = tried;
    }
    this.view.position.copy(middle).addScaledVector(from, away);
    this.view.near = away / 200;
    this.view.far = away * 100;
    this.view.updateProjectionMatrix();
    this.controls.update();
    this.followed.set(...this.courseAt(this.state.frame));
    this.root.localToWorld(this.followed);
    this.following = this.state.moves && !this.state.follow ? SUBJECT : NOTHING;
    this.redraw();
  }

  /**
   * Show some tracks about a time from the present direction.
   * @param {number[]} tracks the first one is followed, so its own motion takes no room
   * @param {number} first frame
   * @param {number} last frame
   */
  focus(tracks, first, last) {
    const { times, axes } = this.capture;
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    const place = [0, 0, 0];
    const [home, lead] = [[0, 0, 0], [0, 0, 0]];
    const isLed = this.places.find(tracks[0], first, home, 0);
    const begin = frameAt(times, times[first] - AROUND);
    const end = frameAt(times, Math.min(times[last], times[first] + AROUND) + AROUND);
    for (let t = begin; t <= end; t++) {
      const moves = isLed && this.places.find(tracks[0], t, lead, 0);
      for (const k of tracks) {
        if (this.places.find(k, t, place, 0) !== SEEN) continue;
        place.forEach((x, i) => {
          const at = moves ? x - lead[i] + home[i] : x;
          low[i] = Math.min(low[i], at);
          high[i] = Math.max(high[i], at);
        });
      }
    }
    if (low[0] > high[0]) return;
    const room = CONTEXT * this.capture.header.radius;
    low.forEach((l, i) => {
      const more = axes === 2 && i === 2 ? 0 : Math.max(0, room - (high[i] - l) / 2);
      low[i] -= more;
      high[i] += more;
    });
    const from = this.view.position.clone().sub(this.controls.target).normalize();
    this.show(corners(low, high), from);
    const n = this.dotOf(tracks[0]);
    this.following = n < 0 ? NOTHING : tracks[0];
    if (n >= 0) this.followed.copy(this.place(n, this.point));
  }

  /** Return whether all points are in view from a distance, with a margin. */
  holds(points, middle, from, away) {
    this.view.position.copy(middle).addScaledVector(from, away);
    this.view.lookAt(middle);
    this.view.near = away / 1000;
    this.view.updateProjectionMatrix();
    this.view.updateMatrixWorld();
    return points.every((point) => {
      const { x, y, z } = this.point.copy(point).project(this.view);
      return Math.abs(x) < 0.9 && Math.abs(y) < 0.86 && z < 1;
    });
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
    this.view.aspect = width / Math.max(1, height);
    this.view.updateProjectionMatrix();
    this.markers.uniforms.ratio.value = ratio;
    this.markers.uniforms.height.value = 0.5 * height * ratio;
  }

  /** Place everything for the current frame, and draw. */
  update() {
    const { state } = this;
    const colour = ink();
    this.markers.update(state, colour);
    this.trails.update(state);
    this.lines.update(state, colour);
    this.frustums.draw(state.camera, state.show.cameras, colour, accent());
    this.keepFollowing();
    this.redraw();
  }

  /** Move the view with the selected track, or else with the subject. */
  keepFollowing() {
    const { state, controls, view } = this;
    const n = state.follow ? this.dotOf(state.chosen) : -1;
    let what = state.moves && !state.follow ? SUBJECT : NOTHING;
    if (n >= 0) {
      what = state.chosen;
      this.place(n, this.point);
    } else if (what === SUBJECT) {
      this.root.localToWorld(this.point.set(...this.courseAt(state.frame)));
    }
    if (what === NOTHING) {
      this.following = NOTHING;
      return;
    }
    // The view keeps its place relative to what it follows; a track that it takes up is centred.
    const begins = this.following !== what;
    const from = begins && n >= 0 ? controls.target : this.followed;
    if (!begins || n >= 0) {
      view.position.add(this.point).sub(from);
      if (begins) controls.target.copy(this.point);
      else controls.target.add(this.point).sub(from);
    }
    this.followed.copy(this.point);
    this.following = what;
    controls.update();
  }

  redraw() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      this.renderer.render(this.scene, this.view);
      this.drawn?.();
    });
  }

  /** Number of the dot of a track in this frame, -1 if it has none. */
  dotOf(track) {
    return track < 0 ? -1 : this.markers.tracks.subarray(0, this.markers.count).indexOf(track);
  }

  /** Position of a dot in the scene. */
  place(n, out) {
    out.fromArray(this.markers.geometry.attributes.position.array, 3 * n);
    return this.root.localToWorld(out);
  }

  /** Position of a point of the scene on the canvas in CSS pixels; z > 1 is behind the view. */
  onCanvas(point) {
    point.project(this.view);
    point.x = (0.5 + 0.5 * point.x) * this.canvas.clientWidth;
    point.y = (0.5 - 0.5 * point.y) * this.canvas.clientHeight;
    return point;
  }

  /** Track with a dot at a position of the canvas, -1 for none. */
  pick(x, y) {
    const n = this.dotAt(x, y, (track) => track >= 0);
    return n < 0 ? -1 : this.markers.tracks[n];
  }

  /** Nearest dot at a position of the canvas among those of some tracks, -1 for none. */
  dotAt(x, y, isOf) {
    let best = -1;
    let least = NEAR_PX;
    for (let n = 0; n < this.markers.count; n++) {
      if (!isOf(this.markers.tracks[n])) continue;
      const p = this.onCanvas(this.place(n, this.point));
      const off = Math.hypot(p.x - x, p.y - y) + (p.z > 1 ? 1e9 : 0);
      if (off < least) [best, least] = [n, off];
    }
    return best;
  }

  /** Rotate the view by angles in radians. */
  turn(across, along) {
    if (this.capture.axes === 2) return;
    const arm = this.view.position.clone().sub(this.controls.target);
    const polar = Math.acos(Math.min(1, Math.max(-1, arm.y / arm.length())));
    const next = Math.min(Math.PI - 0.02, Math.max(0.02, polar + along));
    const right = new Vector3(arm.z, 0, -arm.x).normalize();
    arm.applyAxisAngle(right, next - polar).applyAxisAngle(UP.y, across);
    this.view.position.copy(this.controls.target).add(arm);
    this.controls.update();
    this.redraw();
  }

  /** Multiply the distance of the view by a factor. */
  zoom(factor) {
    const { target } = this.controls;
    this.view.position.sub(target).multiplyScalar(factor).add(target);
    this.controls.update();
    this.redraw();
  }
}

/** Corners of a box. */
function corners(low, high) {
  return [0, 1, 2, 3, 4, 5, 6, 7].map((n) => low.map((l, i) => ((n >> i) & 1 ? high[i] : l)));
}
