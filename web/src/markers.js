/** Markers as dots: filled if detected, hollow in gaps, with a ring if selected or wrong. */

import {
  BufferAttribute, BufferGeometry, Color, DynamicDrawUsage, Points, ShaderMaterial,
} from "three";

import { hueOf } from "./colours.js";
import { ABSENT, GAP } from "./places.js";

const SPARE = 64; // dots for tracks that an editor adds

const VERTEX = `
attribute vec4 look; // colour, kind: 0 filled, 1 hollow, 2 clutter
attribute vec4 ring; // colour, width in pixels (0 for none)
uniform float height, radius, ratio;
varying vec4 vLook, vRing;
varying float vSize, vDot;
void main() {
  vec4 eye = modelViewMatrix * vec4(position, 1.0);
  gl_Position = projectionMatrix * eye;
  float wanted = radius * height * projectionMatrix[1][1] / gl_Position.w;
  float small = look.w > 1.5 ? 0.5 : 1.0;
  vDot = clamp(wanted * small, 3.0 * ratio * small + 0.5, 16.0 * ratio);
  vSize = 2.0 * (vDot + (ring.w > 0.0 ? 2.5 * ratio + ring.w * ratio : 0.0)) + 2.0;
  gl_PointSize = vSize;
  vLook = look;
  vRing = vec4(ring.rgb, ring.w * ratio);
}`;

const FRAGMENT = `
varying vec4 vLook, vRing;
varying float vSize, vDot;
uniform float ratio;
void main() {
  vec2 p = (gl_PointCoord - 0.5) * vSize;
  float r = length(p);
  float inside = clamp(vDot - r + 0.5, 0.0, 1.0);
  vec3 colour = vLook.rgb;
  float alpha = inside;
  if (vLook.w > 1.5) {
    alpha *= 0.7;
  } else if (vLook.w > 0.5) {
    alpha *= clamp(r - vDot + 1.6 * ratio + 0.5, 0.0, 1.0);
  } else {
    vec2 n = p / vDot;
    float light = 0.78 + 0.34 * dot(vec3(n.x, -n.y, sqrt(max(0.0, 1.0 - dot(n, n)))),
      vec3(-0.4, 0.5, 0.62));
    colour *= clamp(light, 0.0, 1.2);
  }
  if (vRing.w > 0.0) {
    float around = vDot + 2.5 * ratio + 0.5 * vRing.w;
    float on = clamp(0.5 * vRing.w - abs(r - around) + 0.5, 0.0, 1.0);
    colour = mix(colour, vRing.rgb, on);
    alpha = max(alpha, on);
  }
  if (alpha < 0.03) discard;
  gl_FragColor = vec4(colour, alpha);
}`;

export class Markers {
  /** @param {import("./unpack.js").Capture} capture */
  constructor(capture, places) {
    this.capture = capture;
    this.places = places;
    let most = 0;
    for (let t = 0; t < capture.T; t++) {
      most = Math.max(most, capture.clutterStart[t + 1] - capture.clutterStart[t]);
    }
    const n = capture.K + most + SPARE;
    const geometry = new BufferGeometry();
    for (const [name, size] of [["position", 3], ["look", 4], ["ring", 4]]) {
      const attribute = new BufferAttribute(new Float32Array(size * n), size);
      attribute.setUsage(DynamicDrawUsage);
      geometry.setAttribute(name, attribute);
    }
    const material = new ShaderMaterial({
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      transparent: true,
      uniforms: { height: { value: 1 }, radius: { value: 0.01 }, ratio: { value: 1 } },
    });
    this.object = new Points(geometry, material);
    this.object.frustumCulled = false;
    this.geometry = geometry;
    this.uniforms = material.uniforms;
    const { cycle, clutter, wrong, missed } = capture.header.colours;
    this.cycle = cycle.map((c) => new Color(c));
    this.clutter = new Color(clutter);
    this.wrong = new Color(wrong);
    this.missed = new Color(missed);
    /** Track of each dot that is drawn, -1 for clutter. */
    this.tracks = new Int32Array(n);
    /** Index of the point of each dot, -1 in a gap. */
    this.points = new Int32Array(n);
    this.count = 0;
  }

  /**
   * Place all dots for the current frame.
   * @param {import("./state.js").State} state
   * @param {Color} ink colour of the ring around the selected marker
   */
  update(state, ink) {
    const { capture, places } = this;
    const position = this.geometry.attributes.position;
    const look = this.geometry.attributes.look;
    const ring = this.geometry.attributes.ring;
    const t = state.frame;
    let n = 0;
    for (let k = 0; k < capture.K && capture.T; k++) {
      const there = places.find(k, t, position.array, 3 * n);
      if (there === ABSENT) continue;
      const point = places.point;
      const isHollow = there === GAP || capture.filled?.[point];
      paint(look, n, this.cycle[hueOf(capture, state.show, k)] ?? this.clutter, isHollow ? 1 : 0);
      const isWrong = state.show.truth && point >= 0 && capture.verdict?.[point] === 1;
      const isMarked = k === state.chosen || k === state.hovered;
      if (isWrong) paint(ring, n, this.wrong, 2.5);
      else paint(ring, n, ink, isMarked ? 1.8 : state.involved.includes(k) ? 1 : 0);
      this.points[n] = point;
      this.tracks[n++] = k;
    }
    const last = capture.T ? capture.clutterStart[t + 1] : 0;
    for (let i = capture.T ? capture.clutterStart[t] : 0; i < last; i++) {
      const isMissed = state.show.truth && capture.verdict?.[i] === 2;
      if (!state.show.clutter && !isMissed) continue;
      for (let a = 0; a < 3; a++) position.array[3 * n + a] = capture.positions[3 * i + a];
      paint(look, n, isMissed ? this.missed : this.clutter, 2);
      paint(ring, n, this.missed, isMissed ? 1.5 : 0);
      this.points[n] = i;
      this.tracks[n++] = -1;
    }
    this.count = n;
    this.geometry.setDrawRange(0, n);
    for (const attribute of [position, look, ring]) attribute.needsUpdate = true;
  }
}

function paint(attribute, i, colour, last) {
  attribute.array[4 * i] = colour.r;
  attribute.array[4 * i + 1] = colour.g;
  attribute.array[4 * i + 2] = colour.b;
  attribute.array[4 * i + 3] = last;
}
