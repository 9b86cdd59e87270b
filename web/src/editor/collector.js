/** Without a server: edits are collected in the page, and downloaded as a file. */

const HEAD = `# Statements about detections, in the order in which they were made. Frames are numbered as in the
# capture, and the points of a frame from 0. The edits of several files of one capture can be put
# into one file, below each other.
`;

export class Collector extends EventTarget {
  /**
   * @param {import("./numbering.js").Numbering} numbering
   * @param {object} header of the editor
   */
  constructor(numbering, header) {
    super();
    Object.assign(this, { numbering, header, edits: [], isSolving: false });
  }

  async do(action, message = {}) {
    if (action === "edit") this.edits.push(this.edit(message));
    else if (action === "undo") {
      if (!this.edits.pop()) throw new Error("There is no edit to take back.");
    } else if (action === "save") this.download();
    this.dispatchEvent(new CustomEvent("state", { detail: { edits: this.edits, n_undone: 0 } }));
    return { version: 0 };
  }

  edit({ kind, detections, name }) {
    const { numbering, header } = this;
    const at = detections.map((i) => {
      const [t, point] = numbering.place(i);
      return [numbering.capture.frames[t] + header.shift, point];
    });
    if (kind === "cut" && this.hides(detections)) {
      throw new Error("Frames in between are not on this page: cut the track by asterism edit.");
    }
    return { kind, at, name, when: `${new Date().toISOString().slice(0, 19)}+00:00` };
  }

  /** Whether there are frames between two detections that the page does not show. */
  hides([one, other]) {
    const { frame, capture } = this.numbering;
    const shown = frame[other] - frame[one];
    return capture.frames[frame[other]] - capture.frames[frame[one]] !== shown;
  }

  download() {
    const lines = [HEAD, `sha256 = "${this.header.sha256}"\n`];
    for (const { kind, at, name, when } of this.edits) {
      const places = at.map(([frame, point]) => `[${frame}, ${point}]`).join(", ");
      lines.push(`\n[[edit]]\nkind = "${kind}"\nat = [${places}]\n`);
      if (name) lines.push(`name = ${quoted(name)}\n`);
      lines.push(`when = "${when}"\n`);
    }
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([lines.join("")], { type: "application/toml" }));
    link.download = this.header.file;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }
}

/** A TOML basic string. */
function quoted(text) {
  const escaped = text.replace(/["\\]/g, "\\$&").replace(/[\u0000-\u001f\u007f]/g, (c) =>
    `\\u${c.charCodeAt(0).toString(16).padStart(4, "0")}`,
  );
  return `"${escaped}"`;
}
