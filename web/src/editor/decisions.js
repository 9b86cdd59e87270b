/** Uncertain decisions, the least certain first, with their alternatives as buttons. */

import { byId, counted, frames, make, named, percent } from "./dom.js";

const SLOW = 0.25; // speed at a decision
const MAX_ALTERNATIVES = 5;
const MIN_SHOWN = 0.01; // probability of an alternative that is offered
const MIN_INVOLVED = 0.05;

export class Decisions {
  /** @param {(message: object) => void} answer */
  constructor({ state, stage, timeline, capture }, answer) {
    Object.assign(this, { state, stage, timeline, capture, answer });
    this.list = [];
    this.shown = null;
    this.assessment = 0;
    this.isWaiting = true; // for the next assessment, to show its first decision
    this.isCurrent = false;
  }

  /** Take up the decisions of an assessment. */
  take({ assessment, decisions }, isCurrent) {
    this.assessment = assessment;
    this.isCurrent = isCurrent;
    this.list = decisions.map((each, i) => ({ ...each, assessment, i }));
    this.tell();
    const same = this.shown && this.list.find((each) => isSame(each, this.shown));
    if (same) {
      this.shown = same;
      this.draw(); // its probabilities may have changed
    } else if ((this.isWaiting || this.isVisited()) && this.list.length) this.show(this.list[0]);
    else {
      this.shown = null;
      this.draw();
    }
  }

  /** Whether the reader is at the shown decision, and has not selected another track. */
  isVisited() {
    return this.shown !== null && this.state.chosen === this.shown.track;
  }

  /** Leave out what a change may have settled; the next assessment follows. */
  changed(tracks) {
    this.isCurrent = false;
    this.list = this.list.filter((each) => !tracks.has(each.track));
    if (this.shown && !this.list.includes(this.shown)) {
      this.shown = null;
      this.isWaiting = true;
    }
    this.tell();
    this.draw();
  }

  /** Go to the next or the previous decision. */
  step(by) {
    const n = this.list.length;
    if (!n) {
      this.isWaiting = true;
      this.draw();
      return;
    }
    const at = this.list.indexOf(this.shown);
    this.show(this.list[at < 0 ? 0 : (at + by + n) % n]);
  }

  show(decision) {
    const { state, stage, timeline } = this;
    this.shown = decision;
    this.isWaiting = false;
    const others = decision.alternatives.filter(
      (each) => each.track !== null && each.probability >= MIN_INVOLVED,
    );
    const tracks = [...new Set([decision.track, ...others.map((each) => each.track)])];
    byId("speed").value = SLOW;
    // At once, so that the scene is drawn once.
    Object.assign(state, { playing: false, involved: tracks, chosen: decision.track, speed: SLOW, follow: true });
    state.seek(decision.at);
    stage?.focus(tracks, decision.at, decision.end);
    timeline.reveal(timeline.rowOf.get(decision.track));
    this.draw();
  }

  /** Choose the answer with a number, from 1. */
  choose(number) {
    const answers = this.shown ? this.answers(this.shown) : [];
    if (number > answers.length) return;
    const { assessment, i } = this.shown;
    this.answer({ assessment, decision: i, alternative: answers[number - 1].alternative });
  }

  /** Answers of a decision: it is right, or one of its alternatives is. */
  answers({ kind, track, name, probability, alternatives }) {
    const unknown = kind === "name" ? "no name" : "another marker";
    const nameOf = (each) =>
      each.name || (each.track === null ? unknown : this.capture.header.names[each.track]);
    const own = kind === "name" ? name : this.capture.header.names[track];
    return [
      { alternative: null, name: own, note: "as it is", probability },
      ...alternatives
        .filter((each) => each.probability >= MIN_SHOWN)
        .slice(0, MAX_ALTERNATIVES)
        .map((each) => ({ alternative: each.i, name: nameOf(each), note: "", probability: each.probability })),
    ];
  }

  draw() {
    const box = byId("decision");
    const hadFocus = box.contains(document.activeElement);
    if (!this.shown) {
      box.replaceChildren(make("p", { className: "quiet" }, this.message()));
      return;
    }
    const { kind, track, first, last, n_detections: n } = this.shown;
    const subject = kind === "name" ? "Which name has track " : "Which marker is ";
    const question = make("p", { className: "question" }, subject, named(this.capture.header.names[track]),
      ` in ${frames(first, last)}?`);
    const place = this.list.indexOf(this.shown) + 1;
    const about = `${counted(n, "point")} · decision ${place} of ${this.list.length}`;
    const buttons = this.answers(this.shown).map(({ name, note, probability }, i) => {
      const button = make("button", { type: "button" },
        make("kbd", { textContent: i + 1 }), make("span", { className: "answer" }, named(name), note && ` ${note}`),
        make("span", { className: "share", textContent: percent(probability) }));
      button.setAttribute("aria-keyshortcuts", i + 1);
      button.style.setProperty("--share", `${Math.round(100 * (probability ?? 0))}%`);
      button.addEventListener("click", () => this.choose(i + 1));
      return make("li", {}, button);
    });
    const skip = make("button", { type: "button", id: "decision-next" }, "Skip", make("kbd", { textContent: "N" }));
    skip.setAttribute("aria-keyshortcuts", "N");
    skip.addEventListener("click", () => this.step(1));
    box.replaceChildren(question, make("p", { className: "quiet" }, about, " ", skip),
      make("ol", { className: "answers" }, ...buttons));
    if (hadFocus) buttons[0].firstChild.focus();
  }

  message() {
    if (!this.isCurrent) return "Assessing the tracks …";
    if (!this.list.length) return "No decision is uncertain.";
    return "N shows the least certain decision.";
  }

  /** Write the number of uncertain decisions at the top of the page. */
  tell() {
    const n = this.list.length;
    byId("uncertain").textContent = n ? `△ ${n.toLocaleString("en")}` : this.isCurrent ? "✓ 0" : "…";
    byId("uncertain-about").textContent = `uncertain decision${n === 1 ? "" : "s"}`;
    byId("uncertain-tile").dataset.severity = n ? "some" : this.isCurrent ? "clear" : "none";
  }
}

function isSame(one, other) {
  return one.track === other.track && one.kind === other.kind && one.first <= other.last && other.first <= one.last;
}
