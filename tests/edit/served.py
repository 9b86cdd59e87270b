"""A server of the editor in its own process, and a plain client of it."""

from __future__ import annotations

import contextlib
import http.client
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from urllib.parse import parse_qs, urlparse

from tests.edit.editors import CAPTURE, Forked, write_capture

__all__ = ["CAPTURE", "Served", "wait", "write_capture"]
_PATIENCE = 60.0


def _command(folder, options):
    """Start the command as a shell does."""
    run = "import sys; from asterism.cli import main; sys.exit(main(sys.argv[1:]))"
    # A group that ignores no signal, as a shell in the background would have it.
    return subprocess.Popen(
        [sys.executable, "-c", run, "edit", CAPTURE, *options],
        cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip


class Served:
    """``asterism edit`` in a folder, from its start to its end by Ctrl-C.

    It runs in a forked process where the capture is tracked already, or as a command of its own.
    """

    def __init__(self, folder, *options, is_command=False):
        self.folder, self.readers = Path(folder), []
        options = ["--no-browser", "--json", *options]
        self.process = (_command if is_command else Forked)(folder, options)
        text = ""
        while not text.endswith("}\n"):
            line = self.process.stdout.readline()
            assert line, self.process.stderr.read()
            text += line
        self.said = json.loads(text)
        self.address = self.said["address"]
        parts = urlparse(self.address)
        self.port, self.token = parts.port, parse_qs(parts.query)["token"][0]
        self.own = f"127.0.0.1:{self.port}"

    def request(self, method, path, body=b"", **headers):
        """Send a request with exactly these headers; return status and text."""
        link = http.client.HTTPConnection("127.0.0.1", self.port, timeout=_PATIENCE)
        link.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
        for name, value in headers.items():
            for each in value if isinstance(value, list) else [value]:
                if each is not None:
                    link.putheader(name.replace("_", "-"), each)
        if body and "Content_Length" not in headers and "Transfer_Encoding" not in headers:
            link.putheader("Content-Length", str(len(body)))
        link.endheaders()
        if body:
            with contextlib.suppress(BrokenPipeError, ConnectionResetError):
                link.send(body)
        answer = link.getresponse()
        text = answer.read().decode()
        link.close()
        return answer.status, text

    def headers(self, **changes):
        """Return the headers that the page sends, with changes; None leaves one out."""
        own = {
            "Host": self.own, "Origin": f"http://{self.own}", "X_Asterism_Token": self.token,
            "Content_Type": "application/json",
        }  # fmt: skip
        return own | changes

    def post(self, action, **message):
        """Carry out an action; return status and answer."""
        body = json.dumps(message).encode()
        status, text = self.request("POST", f"/do/{action}", body, **self.headers())
        return status, json.loads(text) if status == 200 else text

    def listen(self, since=0):
        """Return a list to which the events are added as they come."""
        link = http.client.HTTPConnection("127.0.0.1", self.port, timeout=_PATIENCE)
        link.request("GET", f"/events?since={since}", headers={"x-asterism-token": self.token})
        answer, events = link.getresponse(), []
        assert answer.status == 200

        def read():
            kind = ""
            with contextlib.closing(link), answer:
                for line in answer:
                    name, _, value = line.decode().rstrip("\n").partition(": ")
                    kind = value if name == "event" else kind
                    if name == "data":
                        events.append((kind, json.loads(value)))

        self.readers.append(threading.Thread(target=read))
        self.readers[-1].start()
        return events

    def stop(self, number=signal.SIGINT):
        """End the server; return its exit code and what it printed on stderr."""
        os.kill(self.process.pid, number)
        _, err = self.process.communicate(timeout=_PATIENCE)
        for reader in self.readers:
            reader.join(_PATIENCE)
        return self.process.returncode, err


def wait(condition):
    """Wait until a condition holds."""
    end = time.monotonic() + _PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)
