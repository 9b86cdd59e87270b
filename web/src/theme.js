/** Colours of the page from its style sheet, light or dark. */

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

/** The colours as text, for 2-D canvases. */
export function css(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/** Register a listener for a change between light and dark. */
export function onTheme(changed) {
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    cache.clear();
    changed();
  });
}
