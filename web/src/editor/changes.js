/** What an edit changed, asked for or not, and the list of all edits. */

import { byId, counted, frames, make, named } from "./dom.js";

const MAX_LISTED = 5;
const WORDS = {
  same: "one marker", only: "one marker, there alone", different: "different markers", cut: "cut", clutter: "ghost",
  name: "name", fill: "filled", no_fill: "left open",
  reassign: "assigned again", reassign_even: "assigned at even odds",
};

export class Changes {
  /** @param {(message: object) => void} refuse */
  constructor(capture, refuse) {
    Object.assign(this, { capture, refuse, latest: null });
  }

  /** Show the stretches of a change. */
  show(change) {
    this.latest = change;
    const asked = change.stretches.filter((each) => each.is_asked);
    const also = change.stretches.filter((each) => !each.is_asked);
    const parts = [];
    if (!change.is_new) parts.push(make("p", {}, `Undone: ${WORDS[change.edit.kind]}.`));
    else if (!change.stretches.length) parts.push(make("p", {}, `Confirmed: ${WORDS[change.edit.kind]}${change.edit.name && ` ${change.edit.name}`}.`));
    if (asked.length) {
      parts.push(this.listed(asked));
    }
    if (also.length) {
      const items = also.slice(0, MAX_LISTED).map((each) => {
        const button = make("button", { type: "button" }, "Take back", each === also[0] ? make("kbd", { textContent: "R" }) : "");
        button.addEventListener("click", () => this.take(each));
        return make("li", {}, ...this.line(each), " ", button);
      });
      parts.push(make("p", {}, "Also changed with it:"), make("ul", {}, ...items, ...rest(also)));
    }
    byId("changed").replaceChildren(...parts);
  }

  /** The tracks before and after, the frames and the size of a stretch. */
  line({ source, target, first, last, n_detections }) {
    const name = (k) => (k < 0 ? "clutter" : named(this.capture.header.names[k]));
    return [name(source), " → ", name(target), `, ${frames(first, last)}, ${counted(n_detections, "point")}`];
  }

  /** A list of stretches. */
  listed(stretches) {
    const items = stretches.slice(0, MAX_LISTED).map((each) => make("li", {}, ...this.line(each)));
    return make("ul", {}, ...items, ...rest(stretches));
  }

  clear() {
    this.latest = null;
    byId("changed").replaceChildren();
  }

  /** Take back a stretch that was not asked for, by default the first. */
  take(stretch = this.latest?.stretches.find((each) => !each.is_asked)) {
    if (!stretch) throw new Error("Nothing else changed with the last edit.");
    this.refuse({ version: this.latest.version, stretch: this.latest.stretches.indexOf(stretch) });
  }

  /** List the edits, the last one first. */
  list(edits) {
    const items = edits.map(({ kind, at, name }) => {
      const places = kind.startsWith("reassign") ? (at.length ? `without ${counted(at.length, "point")}` : "") : at.map(([frame, point]) => `frame ${frame} point ${point}`).join(", ");
      return make("li", {}, `${WORDS[kind]} `, name ? named(name) : "", ` ${places}`);
    });
    byId("edit-list").replaceChildren(...items.reverse().slice(0, 200));
  }
}

function rest(list) {
  return list.length > MAX_LISTED ? [make("li", {}, `and ${list.length - MAX_LISTED} more`)] : [];
}
