/** The server: actions by POST, and the events that every page of a session receives. */

const TOKEN = new URLSearchParams(location.search).get("token") ?? "";
const HEADERS = { "x-asterism-token": TOKEN };
const AGAIN_MS = 1500; // before a lost connection is tried again

export class Server extends EventTarget {
  constructor(version) {
    super();
    this.version = version;
    this.isSolving = true;
    this.listen();
  }

  /**
   * Carry out an action. The answer comes after the edit is on disk.
   * @throws {Error} with the reason, if nothing was changed
   */
  async do(action, message = {}) {
    let response;
    try {
      response = await fetch(`/do/${action}`, {
        method: "POST",
        headers: { ...HEADERS, "content-type": "application/json" },
        body: JSON.stringify(message),
      });
    } catch {
      throw new Error("The server does not answer. The edit was not confirmed.");
    }
    if (!response.ok) throw new Error((await response.text()).trim());
    return response.json();
  }

  async listen() {
    for (;;) {
      try {
        const response = await fetch(`/events?since=${this.version}`, { headers: HEADERS });
        if (response.ok) await this.read(response.body.pipeThrough(new TextDecoderStream()));
      } catch (error) {
        console.info(error.message);
      }
      this.tell("lost");
      await new Promise((done) => setTimeout(done, AGAIN_MS));
    }
  }

  async read(stream) {
    let text = "";
    this.tell("found");
    for await (const piece of chunks(stream)) {
      text += piece;
      const parts = text.split("\n\n");
      text = parts.pop();
      for (const part of parts) {
        const event = /^event: (.*)\ndata: (.*)$/.exec(part);
        if (event) this.tell(event[1], JSON.parse(event[2]));
      }
    }
  }

  tell(kind, detail = null) {
    this.dispatchEvent(new CustomEvent(kind, { detail }));
  }
}

async function* chunks(stream) {
  const reader = stream.getReader();
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return;
    yield value;
  }
}
