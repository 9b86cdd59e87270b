/** The stream of the server: one JSON object a line, by fetch, which can carry the secret. */

const TOKEN = new URLSearchParams(location.search).get("token") ?? "";
const AGAIN_MS = 1000; // before a lost connection is tried again

/** Call `take` with every object, and `lost` whenever the connection ends. */
export async function listen(take, lost) {
  for (;;) {
    try {
      const response = await fetch("/frames", { headers: { "x-asterism-token": TOKEN } });
      if (!response.ok) throw new Error((await response.text()).trim());
      const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
      let text = "";
      for (;;) {
        const { done, value } = await reader.read();
        if (done) break;
        const lines = (text + value).split("\n");
        text = lines.pop();
        for (const line of lines) if (line) take(JSON.parse(line));
      }
    } catch (error) {
      console.info(error.message);
    }
    lost();
    await new Promise((done) => setTimeout(done, AGAIN_MS));
  }
}
