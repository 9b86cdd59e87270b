/** Field for a name, with the names of the marker sets and the next free one. */

import { byId, make } from "./dom.js";

export class Naming {
  /** @param {(name: string) => void} give */
  constructor(capture, names, give) {
    Object.assign(this, { capture, give });
    this.names = names;
    this.last = -1; // in the order of the marker sets
    this.field = byId("edit-name");
    byId("edit-naming").addEventListener("submit", (event) => {
      event.preventDefault();
      const name = this.field.value.trim() || this.field.placeholder;
      if (name) this.give(name);
      this.last = this.names.indexOf(name);
      this.field.value = "";
      this.field.blur();
      this.list();
    });
    this.field.addEventListener("keydown", (event) => {
      if (event.key === "Escape") this.field.blur();
    });
    this.field.addEventListener("focus", () => this.list());
    this.list();
  }

  /** Go to the field; the next free name is in it. */
  begin() {
    this.list();
    this.field.value = this.field.placeholder;
    this.field.focus();
    this.field.select();
  }

  list() {
    const { header, starts } = this.capture;
    const used = new Set(header.names.filter((_, k) => starts[k + 1] > starts[k]));
    const known = this.names.length ? this.names : [...used].filter((name) => !/^track \d+$/i.test(name));
    byId("edit-names").replaceChildren(...known.map((value) => make("option", { value })));
    const n = this.names.length;
    const order = [...Array(n).keys()].map((i) => this.names[(this.last + 1 + i) % n]);
    this.field.placeholder = order.find((name) => !used.has(name)) ?? "";
  }
}
