"""A headless Chromium, driven over two pipes: no driver program, no port, no package."""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader",
    "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--hide-scrollbars",
    "--force-color-profile=srgb", "--remote-debugging-pipe",
)  # fmt: skip
# The browser reads commands from file 3 and answers on file 4.
_LAUNCH = (
    "import os, sys; r, w = map(int, sys.argv[1:3]); "
    "a, b = os.dup(r), os.dup(w); os.dup2(a, 3); os.dup2(b, 4); "
    "os.set_inheritable(3, True); os.set_inheritable(4, True); os.execv(sys.argv[3], sys.argv[3:])"
)
_PATIENCE = 60.0


class Browser:
    """One browser with an empty profile; `page` opens files in it."""

    def __init__(self):
        self.profile = tempfile.mkdtemp(prefix="profile")
        read_commands, self.commands = os.pipe()
        self.answers, write_answers = os.pipe()
        pipes = (str(read_commands), str(write_answers))
        profile = f"--user-data-dir={self.profile}"
        self.process = subprocess.Popen(
            [sys.executable, "-c", _LAUNCH, *pipes, CHROMIUM, *FLAGS, profile],
            pass_fds=(read_commands, write_answers),
            stderr=subprocess.DEVNULL,
        )
        os.close(read_commands)
        os.close(write_answers)
        self.buffer, self.events, self.n = b"", [], 0

    def call(self, method, session=None, **parameters):
        """Send a command and give its answer; events that come meanwhile are kept."""
        self.n += 1
        message = {"id": self.n, "method": method, "params": parameters}
        if session is not None:
            message["sessionId"] = session
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self.commands, data) :]
        end = time.monotonic() + _PATIENCE
        while True:
            answer = self._next(end - time.monotonic())
            if answer.get("id") == message["id"]:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]
            self.events.append(answer)

    def _next(self, patience):
        while b"\0" not in self.buffer:
            if not select.select([self.answers], [], [], max(0.0, patience))[0]:
                raise TimeoutError("the browser does not answer")
            piece = os.read(self.answers, 1 << 20)
            if not piece:
                raise RuntimeError("the browser is gone")
            self.buffer += piece
        first, _, self.buffer = self.buffer.partition(b"\0")
        return json.loads(first)

    def page(self, path, *, width=1280, height=900, dark=False, scale=1, before=""):
        """Open a file or an address, after a script of ours, and wait until its player is ready."""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        page = Page(self, session, target)
        for domain in ("Page", "Runtime", "Network", "Log", "Security"):
            page.call(f"{domain}.enable")
        page.call(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=scale, mobile=width < 600,
        )  # fmt: skip
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        page.call("Emulation.setEmulatedMedia", features=[scheme])
        page.call("Page.addScriptToEvaluateOnNewDocument", source=before)
        is_address = str(path).startswith("http://")
        page.call("Page.navigate", url=path if is_address else Path(path).resolve().as_uri())
        page.wait("document.body?.dataset.ready === 'true'")
        return page

    def close(self):
        """End the browser and remove its profile."""
        try:
            self.call("Browser.close")
        except (OSError, RuntimeError, TimeoutError):
            self.process.kill()
        self.process.wait(30)
        os.close(self.commands)
        os.close(self.answers)
        shutil.rmtree(self.profile, ignore_errors=True)


class Page:
    """An open page."""

    def __init__(self, browser, session, target):
        self.browser, self.session, self.target = browser, session, target

    def call(self, method, **parameters):
        return self.browser.call(method, session=self.session, **parameters)

    def run(self, expression):
        """Evaluate JavaScript; give its value."""
        answer = self.call(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        if "exceptionDetails" in answer:
            raise RuntimeError(json.dumps(answer["exceptionDetails"])[:2000])
        return answer["result"].get("value")

    def wait(self, condition):
        """Wait until an expression is true."""
        end = time.monotonic() + _PATIENCE
        while not self.run(condition):
            if time.monotonic() > end:
                raise TimeoutError(f"{condition}; {self.complaints()}")
            time.sleep(0.05)

    def settle(self):
        """Let what was asked for be drawn."""
        self.run("new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)))")

    def events(self, *methods):
        return [
            e["params"]
            for e in self.browser.events
            if e.get("sessionId") == self.session and e.get("method") in methods
        ]

    def complaints(self):
        """Errors and warnings that the page or the browser had."""
        thrown = self.events("Runtime.exceptionThrown")
        printed = [
            e
            for e in self.events("Runtime.consoleAPICalled")
            if e["type"] in ("error", "warning", "assert")
        ]
        logged = [
            e["entry"]
            for e in self.events("Log.entryAdded")
            if e["entry"]["level"] in ("error", "warning")
            and "GL Driver Message" not in e["entry"]["text"]  # that screenshots take time
        ]
        return [json.dumps(e)[:800] for e in (*thrown, *printed, *logged)]

    def requests(self):
        """Addresses that were asked for."""
        return [e["request"]["url"] for e in self.events("Network.requestWillBeSent")]

    def key(self, key, *, shift=False):
        """Press a key and let it go."""
        codes = {" ": 32, "Tab": 9, "ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39}
        codes |= {"ArrowDown": 40, "Home": 36, "End": 35, "Escape": 27, "Enter": 13}
        known = {"key": key, "windowsVirtualKeyCode": codes.get(key, ord(key.upper()[0]))}
        known |= {"modifiers": 8 if shift else 0}
        text = key if len(key) == 1 else "\r" if key == "Enter" else None
        self.call(
            "Input.dispatchKeyEvent", type="keyDown", **known, **({"text": text} if text else {})
        )
        self.call("Input.dispatchKeyEvent", type="keyUp", **known)

    def click(self, x, y):
        """Click at a place of the window."""
        self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def screenshot(self, path=None, *, whole=False):
        """Give a PNG of the window or of the whole page, and write it to `path`."""
        self.settle()
        data = self.call("Page.captureScreenshot", captureBeyondViewport=whole, **(
            {"clip": self._whole()} if whole else {}
        ))["data"]  # fmt: skip
        png = base64.b64decode(data)
        if path is not None:
            Path(path).write_bytes(png)
        return png

    def _whole(self):
        size = self.call("Page.getLayoutMetrics")["cssContentSize"]
        return {"x": 0, "y": 0, "width": size["width"], "height": size["height"], "scale": 1}

    def close(self):
        self.browser.call("Target.closeTarget", targetId=self.target)
