/** Colours of the page, light or dark, as the style sheet has them. */

import { Color } from "three";

const cache = new Map();

function named(name) {
  if (!cache.has(name)) {
    const value = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
    cache.set(name, new Color(value));
  }
  return cache.get(name);
}

export const ink = () => named("--ink");
export const accent = () => named("--accent");

/** The same as text for 2-D canvases. */
export function css(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/** Call back when the system goes from light to dark or back. */
export function onTheme(changed) {
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    cache.clear();
    changed();
  });
}
