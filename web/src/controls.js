/** Buttons, boxes and keys. */

const SLOW = 0.25; // speed at a place to check

const byId = (id) => document.getElementById(id);

/** @returns {Record<string, (event: KeyboardEvent) => void>} actions by key, which the editor extends */
export function connect({ capture, state, stage, timeline }) {
  const slider = byId("frame");
  slider.max = Math.max(0, capture.T - 1);
  slider.addEventListener("input", () => state.seek(Number(slider.value)));
  byId("play").addEventListener("click", () => state.play(!state.playing));
  byId("back").addEventListener("click", () => step(-1));
  byId("on").addEventListener("click", () => step(1));
  byId("speed").addEventListener("change", (event) => state.set({ speed: Number(event.target.value) }));
  byId("follow").addEventListener("change", (event) => state.set({ follow: event.target.checked }));
  byId("release").addEventListener("click", () => state.choose(-1));
  byId("camera")?.addEventListener("change", (event) =>
    state.set({ camera: Number(event.target.value) }),
  );
  byId("order").addEventListener("change", (event) => {
    timeline.sort(event.target.value);
    timeline.draw();
  });
  const moves = byId("track-subject");
  moves.addEventListener("change", () => {
    if (moves.checked) stage?.fitSubject();
    else state.set({ moves: false });
  });
  state.addEventListener("change", () => {
    moves.checked = state.moves;
  });
  byId("fit").addEventListener("click", () => stage?.fit());
  byId("up")?.addEventListener("change", (event) => {
    stage?.setUp(event.target.value);
    stage?.fitSubject();
  });
  byId("trails").addEventListener("change", (event) => show({ trails: Number(event.target.value) }));
  byId("colours").addEventListener("change", (event) => show({ colours: event.target.value }));
  for (const name of ["names", "lines", "clutter", "cameras", "truth"]) {
    byId(`show-${name}`)?.addEventListener("change", (event) => {
      show({ [name]: event.target.checked });
      if (name === "truth") timeline.resize();
    });
  }

  const found = [...document.querySelectorAll(".list button")];
  let at = -1;
  found.forEach((button, i) =>
    button.addEventListener("click", () => {
      at = i;
      go(button);
    }),
  );

  function go(button) {
    for (const other of found) {
      if (other === button) other.setAttribute("aria-current", "true");
      else other.removeAttribute("aria-current");
    }
    state.play(false);
    const [track, frame] = [Number(button.dataset.track), Number(button.dataset.frame)];
    const involved = (button.dataset.tracks ?? "").split(" ").filter(Boolean).map(Number);
    state.involved = involved;
    state.choose(track);
    if (involved.length) {
      byId("speed").value = SLOW;
      state.set({ speed: SLOW, follow: true });
    }
    state.seek(frame);
    if (involved.length) stage?.focus(involved, frame, Number(button.dataset.last));
    timeline.reveal(timeline.rowOf.get(track));
  }

  function visit(by) {
    if (!found.length) return;
    at = (at + by + found.length) % found.length;
    const folded = found[at].closest("details");
    if (folded) folded.open = true;
    found[at].scrollIntoView({ block: "nearest" });
    go(found[at]);
  }

  function step(by) {
    state.play(false);
    state.seek(state.frame + by);
  }

  function show(changes) {
    Object.assign(state.show, changes);
    state.changed();
  }

  const keys = {
    " ": () => state.play(!state.playing),
    ArrowLeft: (event) => step(event.shiftKey ? -10 : -1),
    ArrowRight: (event) => step(event.shiftKey ? 10 : 1),
    Home: () => step(-Infinity),
    End: () => step(Infinity),
    n: () => visit(1),
    p: () => visit(-1),
    "[": () => timeline.step(-1),
    "]": () => timeline.step(1),
    f: () => state.chosen >= 0 && state.set({ follow: !state.follow }),
    l: () => byId("show-names").click(),
    Escape: () => state.choose(-1),
    a: () => stage?.turn(-0.15, 0),
    d: () => stage?.turn(0.15, 0),
    w: () => stage?.turn(0, -0.1),
    s: () => stage?.turn(0, 0.1),
    "+": () => stage?.zoom(0.87),
    "=": () => stage?.zoom(0.87),
    "-": () => stage?.zoom(1.15),
    0: () => stage?.fit(),
    m: () => stage?.fitSubject(),
  };

  addEventListener("keydown", (event) => {
    if (event.defaultPrevented) return;
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (ownKeys(event)) return;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const act = keys[key];
    if (!act) return;
    event.preventDefault();
    act(event);
  });
  return keys;
}

/** Return whether the focused element handles a key itself. */
function ownKeys(event) {
  const { target, key } = event;
  const tag = target.tagName;
  if (tag === "SELECT" || target.type === "text") return true;
  if (tag === "BUTTON" || tag === "SUMMARY" || tag === "A") return key === " " || key === "Enter";
  if (target.type === "checkbox") return key === " ";
  return target.type === "range" && (key.startsWith("Arrow") ? !event.shiftKey : false);
}

/** Select markers with the pointer, and show the name of the one under it. */
export function connectPointer(stage, state) {
  const { canvas } = stage;
  let down = null;
  canvas.addEventListener("pointerdown", (event) => {
    down = [event.offsetX, event.offsetY];
  });
  canvas.addEventListener("pointerup", (event) => {
    if (!down) return;
    const moved = Math.hypot(event.offsetX - down[0], event.offsetY - down[1]);
    down = null;
    if (moved < 5) state.choose(stage.pick(event.offsetX, event.offsetY));
  });
  canvas.addEventListener("pointermove", (event) => {
    if (event.buttons) return;
    const over = stage.pick(event.offsetX, event.offsetY);
    canvas.classList.toggle("over", over >= 0);
    if (over !== state.hovered) state.set({ hovered: over });
  });
  canvas.addEventListener("pointerleave", () => state.hovered >= 0 && state.set({ hovered: -1 }));
}
