/** Elements of the page; text is never interpreted as HTML. */

export const byId = (id) => document.getElementById(id);

/** Make an element with properties and children; texts become text. */
export function make(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

/** A name from a file, kept apart from the direction of the text around it. */
export const named = (name) => make("bdi", { textContent: name });

/** A probability in percent. */
export function percent(p) {
  return `${Math.round(100 * Math.min(Math.max(p ?? 0, 0.01), 0.99))}\u00a0%`;
}

/** Frames as text. */
export function frames(first, last) {
  return first === last ? `frame ${first}` : `frames ${first} to ${last}`;
}

/** A number with its noun. */
export function counted(n, noun) {
  return `${n.toLocaleString("en")} ${noun}${n === 1 ? "" : "s"}`;
}
