/** The editor of the page: with a server it solves each edit, without one it collects them. */

import "../styles/editor.css";

import { Changes } from "./changes.js";
import { Collector } from "./collector.js";
import { Corrections } from "./corrections.js";
import { Decisions } from "./decisions.js";
import { byId, counted, frames, make } from "./dom.js";
import { Naming } from "./naming.js";
import { Numbering } from "./numbering.js";
import { Overlay } from "./overlay.js";
import { Selection } from "./selection.js";
import { Server } from "./server.js";

addEventListener("player", ({ detail }) => new Editor(detail), { once: true });

class Editor {
  constructor(player) {
    const { capture, state, stage, timeline, keys } = player;
    const header = capture.header.editor;
    Object.assign(this, { ...player, header, early: new Map(), edits: [], pending: 0, isLost: false, isAhead: false });
    this.numbering = new Numbering(capture);
    this.server = header.is_served ? new Server(header.version) : new Collector(this.numbering, header);
    this.selection = new Selection(player, this.numbering);
    this.overlay = stage && new Overlay(stage, this.selection);
    this.corrections = new Corrections({ state, capture }, this.numbering, this.selection);
    this.changes = new Changes(capture, (message) => this.send("refuse", message));
    this.decisions = new Decisions({ state, stage, timeline, capture }, (message) => this.make("choose", message));
    this.naming = new Naming(capture, header.names, (name) => this.correct(() => this.corrections.name(name)));
    this.listen();
    this.connect(keys);
    if (!header.is_served) this.withoutServer();
    this.tell();
    this.selection.draw();
    document.body.dataset.editor = "ready";
  }

  listen() {
    const on = (kind, act) => this.server.addEventListener(kind, ({ detail }) => act(detail));
    on("change", (event) => this.take(event));
    on("state", ({ edits, n_undone }) => {
      Object.assign(this, { edits, n_undone });
      this.changes.list(edits);
      this.tell();
    });
    on("assessment", (event) => this.assessed(event));
    on("saved", ({ saved }) => {
      byId("edit-saved").textContent = `Saved: ${saved}`;
    });
    on("lost", () => this.connected(false));
    on("found", () => this.connected(true));
  }

  connect(keys) {
    const { corrections, decisions, selection } = this;
    const act = {
      swap: () => this.correct(() => corrections.swap()),
      here: () => this.correct(() => corrections.here()),
      mark: () => this.mark(),
      ahead: () => this.lookAhead(),
      join: () => this.correct(() => corrections.join()),
      apart: () => this.correct(() => corrections.apart()),
      cut: () => this.correct(() => corrections.cut(false)),
      "cut-back": () => this.correct(() => corrections.cut(true)),
      "cut-whole": () => this.correct(() => corrections.cutWhole()),
      ghost: () => this.correct(() => corrections.ghost()),
      fill: () => this.preview(),
      open: () => this.fill("no_fill"),
      keep: () => selection.keep(),
      reassign: () => this.previewAgain(false),
      "reassign-even": () => this.previewAgain(true),
      lasso: () => this.overlay?.lasso(!this.overlay.isOn),
      undo: () => this.send("undo"),
      redo: () => this.send("redo"),
      save: () => this.send("save"),
      keys: () => this.showKeys(),
    };
    for (const [name, does] of Object.entries(act)) byId(`edit-${name}`).addEventListener("click", does);
    Object.assign(keys, {
      n: () => decisions.step(1), p: () => decisions.step(-1),
      x: act.swap, v: act["cut-whole"], k: act.ghost, e: act.keep,
      j: (event) => (event.shiftKey ? act.apart : act.join)(),
      g: (event) => (event.shiftKey ? act.open : act.fill)(),
      t: (event) => act[event.shiftKey ? "reassign-even" : "reassign"](),
      h: (event) => (event.shiftKey ? act.mark : act.here)(), q: act.ahead,
      c: (event) => (event.shiftKey ? act["cut-back"] : act.cut)(),
      o: act.lasso, u: () => selection.stepPoint(), i: () => this.naming.begin(),
      z: (event) => (event.shiftKey ? act.redo : act.undo)(), y: act.redo, b: act.save,
      r: () => this.attempt(() => this.changes.take()), "?": act.keys,
    });
    for (let n = 1; n <= 9; n++) keys[n] = () => (this.leave ? this.leave(n - 1) : decisions.choose(n));
    keys.Enter = () => this.confirm?.();
    const escape = keys.Escape;
    keys.Escape = (event) => {
      this.preview(null);
      this.overlay?.lasso(false);
      selection.kept = -1;
      escape(event);
    };
  }

  /** Carry out corrections, one after the other. */
  async correct(make) {
    let edits;
    this.attempt(() => {
      edits = make();
    });
    for (const edit of edits ?? []) if (!(await this.make("edit", edit))) return;
  }

  /** Mark the frame from which two tracks are exchanged. */
  mark() {
    const is = this.corrections.mark() >= 0;
    byId("edit-mark").ariaPressed = `${is}`;
  }

  /** Preview each edit before it is made, or no longer. */
  lookAhead() {
    this.isAhead = !this.isAhead;
    byId("edit-ahead").ariaPressed = `${this.isAhead}`;
  }

  /** Make an edit, with a preview where the reader wants one; null if it is not made. */
  async make(action, message) {
    if (!this.isAhead) return this.send(action, message);
    this.preview(null);
    const answer = await this.send(`preview_${action}`, message);
    if (!answer) return null;
    const n = answer.stretches.reduce((sum, each) => sum + each.n_detections, 0);
    return new Promise((made) => {
      this.confirm = () => {
        this.preview(null);
        made(this.send(action, message));
      };
      byId("filling").replaceChildren(
        make("p", {}, `With this edit, ${counted(n, "point")} would change:`),
        make("div", { className: "tools" }, button("Confirm", "Enter", this.confirm), button("Dismiss", "Esc", () => this.preview(null))),
        this.changes.listed(answer.stretches),
      );
    });
  }

  attempt(act) {
    try {
      this.fail("");
      act();
    } catch (error) {
      this.fail(error.message);
    }
  }

  /** Send an action; its effect is shown once the server has confirmed it. */
  async send(action, message = {}) {
    this.fail("");
    this.pending += 1;
    this.tell();
    try {
      const answer = await this.server.do(action, message);
      if (answer.labels) this.take(answer);
      if (answer.saved) byId("edit-saved").textContent = `Saved: ${answer.saved}`;
      return answer;
    } catch (error) {
      this.fail(error.message);
      return null;
    } finally {
      this.pending -= 1;
      this.tell();
    }
  }

  /** Take up a change, in the order of versions; each page receives every change. */
  take(event) {
    if (event.version <= this.server.version) return;
    this.early.set(event.version, event);
    for (let next; (next = this.early.get(this.server.version + 1)); ) {
      this.early.delete(next.version);
      this.server.version = next.version;
      this.apply(next);
    }
  }

  apply(event) {
    const { capture, numbering, stage, timeline } = this;
    const began = performance.now();
    const touched = new Set(event.labels);
    for (const i of event.detections) touched.add(numbering.label[i]);
    event.detections.forEach((i, n) => {
      numbering.label[i] = event.labels[n];
    });
    for (const [track, name] of Object.entries(event.names)) {
      capture.header.names[track] = name;
      touched.add(Number(track));
    }
    for (let k = 0; k < capture.header.names.length; k++) capture.header.names[k] ??= `track ${k}`;
    const { edits, n_undone } = event;
    Object.assign(this, { edits, n_undone });
    numbering.rebuild();
    if (stage && capture.K + numbering.mostClutter > stage.markers.tracks.length) stage.grow();
    timeline.sort(byId("order").value);
    timeline.renew(touched);
    if (this.decisions.shown) touched.add(this.decidedBy(event));
    this.changes.show(event);
    this.changes.list(edits);
    this.preview(null);
    this.decisions.changed(touched);
    byId("edit-mark").ariaPressed = `${this.corrections.marked >= 0}`;
    this.naming.list();
    if (!this.decisions.shown && this.decisions.list.length) this.decisions.step(1);
    else this.draw();
    this.tell();
    document.body.dataset.applied = (performance.now() - began).toFixed(1);
  }

  /** Track of the shown decision if an edit is about it, though nothing changed. */
  decidedBy({ edit, is_new }) {
    const { shown } = this.decisions;
    const isAbout = edit.at.some(([frame]) => frame >= shown.first && frame <= shown.last);
    return is_new && isAbout ? shown.track : -1;
  }

  assessed(event) {
    const { numbering, capture } = this;
    if (event.detections.length && numbering.confidence) {
      event.detections.forEach((i, n) => {
        numbering.confidence[i] = event.confidences[n];
      });
      for (let row = 0; row < numbering.numberOf.length; row++) {
        capture.confidence[row] = numbering.confidence[numbering.numberOf[row]];
      }
      this.timeline.renew(new Set(event.detections.map((i) => numbering.label[i])));
      this.timeline.draw();
    }
    this.decisions.take(event, event.assessment === this.server.version);
  }

  /** Show how the gap of the selected track would be filled; null for nothing. */
  async preview(gap) {
    if (gap === null) {
      this.filling = this.confirm = this.leave = null;
      if (this.overlay) this.overlay.fill = null;
      byId("filling").replaceChildren();
      return;
    }
    let found;
    this.attempt(() => {
      found = this.corrections.gap();
    });
    if (!found) return;
    this.state.seek(found.first);
    const answer = await this.send("preview", found);
    if (!answer) return;
    this.filling = found;
    this.confirm = () => this.fill("fill");
    if (this.overlay) this.overlay.fill = answer;
    const worst = 1000 * Math.max(...answer.sigma);
    byId("filling").replaceChildren(
      make("p", {}, `Gap, ${frames(answer.first, answer.last)}: standard deviation up to ${worst.toPrecision(2)} mm. The band is two of them.`),
      make("div", { className: "tools" }, button("Fill", "Enter", this.confirm), button("Leave open", "⇧G", () => this.fill("no_fill"))),
    );
    this.stage?.redraw();
  }

  /** Show what an assignment of all uncertain points, perhaps at even odds, would change. */
  async previewAgain(is_even) {
    this.preview(null);
    const answer = await this.send("preview_reassign", { is_even });
    if (!answer) return;
    const { stretches, version } = answer;
    if (!stretches.length) {
      byId("filling").replaceChildren(make("p", {}, "Assigned again, no point would change."));
      return;
    }
    const groups = grouped(stretches);
    const left = new Set();
    const about = make("p", {});
    const count = () => {
      const n = stretches.reduce((sum, each) => sum + (left.has(each.group) ? 0 : each.n_detections), 0);
      about.textContent = `Assigned again, ${counted(n, "point")} would change:`;
    };
    const rows = groups.map((group, i) => {
      const toggle = button("Leave out", i < 9 ? `${i + 1}` : "", () => this.leave(i));
      toggle.ariaPressed = "false";
      return make("li", {}, this.changes.listed(group), toggle);
    });
    this.leave = (i) => {
      if (i >= groups.length) return;
      const { group } = groups[i][0];
      if (!left.delete(group)) left.add(group);
      rows[i].classList.toggle("omitted", left.has(group));
      rows[i].querySelector("button").ariaPressed = `${left.has(group)}`;
      count();
    };
    this.confirm = () => {
      this.preview(null);
      this.send("reassign", { version, without: [...left] });
    };
    count();
    byId("filling").replaceChildren(
      about,
      make("div", { className: "tools" }, button("Confirm", "Enter", this.confirm), button("Dismiss", "Esc", () => this.preview(null))),
      make("ol", { className: "offered" }, ...rows),
    );
  }

  /** Fill the gap of the preview, or that of the selected track, or leave it open. */
  fill(kind) {
    let gap = this.filling;
    this.attempt(() => {
      gap ??= this.corrections.gap();
    });
    if (!gap) return;
    this.preview(null);
    this.send("fill", { ...gap, kind });
  }

  showKeys() {
    const keys = byId("keys");
    keys.open = !keys.open;
    if (keys.open) keys.scrollIntoView({ block: "nearest" });
    keys.querySelector("summary").focus({ preventScroll: !keys.open });
  }

  withoutServer() {
    for (const name of ["fill", "open", "redo", "reassign", "reassign-even", "ahead"]) byId(`edit-${name}`).hidden = true;
    byId("edit-save").firstChild.textContent = "Download edits";
    byId("decision").hidden = true;
    byId("uncertain-tile").hidden = true;
  }

  connected(is) {
    this.isLost = !is;
    if (!is) this.fail("The server does not answer: start asterism edit again. Nothing is recorded meanwhile.");
    else if (byId("edit-error").textContent.startsWith("The server does not")) this.fail("");
    this.tell();
  }

  fail(text) {
    const error = byId("edit-error");
    error.textContent = text;
    error.hidden = !text;
  }

  /** Show how many edits are on disk, as the server has confirmed. */
  tell() {
    const n = this.edits.length;
    const where = this.header.is_served ? "on disk" : "in this page";
    const text = this.isLost ? "no connection" : this.pending ? "…" : `${counted(n, "edit")} ${where}`;
    if (byId("edit-state").textContent !== text) byId("edit-state").textContent = text;
    byId("edit-undo").disabled = !n;
    byId("edit-redo").disabled = !this.n_undone;
  }
}

/** The stretches that only change together, those with the most points first. */
function grouped(stretches) {
  const groups = new Map();
  for (const each of stretches) groups.set(each.group, [...(groups.get(each.group) ?? []), each]);
  const size = (group) => group.reduce((sum, each) => sum + each.n_detections, 0);
  for (const group of groups.values()) group.sort((a, b) => b.n_detections - a.n_detections);
  return [...groups.values()].sort((a, b) => size(b) - size(a));
}

function button(text, key, act) {
  const made = make("button", { type: "button" }, text, key && make("kbd", { textContent: key }));
  made.addEventListener("click", act);
  return made;
}
