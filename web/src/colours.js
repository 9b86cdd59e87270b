/** Colour of a track: its own, or that of its segment. */

/** Index in the cycle of colours, -1 for a track in no segment. */
export function hueOf(capture, show, track) {
  const number = show.colours === "segment" ? capture.segments[track] : track;
  return number < 0 ? -1 : number % capture.header.colours.cycle.length;
}
