"""Independent clients receive frames of 60 markers from servers and sinks, equal to what is sent.

Each client runs in a process of its own, in every version of the protocol that it speaks. The
frames are those of 240 Hz and are sent as fast as the client takes them: the sender is never more
than 20 frames ahead, because UDP would lose what does not fit into the client's buffer.

    python benchmarks/live_clients.py [--frames N] [--clients NAME …] [--markdown FILE]

All clients take hours; the table keeps the rows of those that are not measured again.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import json
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.live import LiveFrame, NatNetServer, QtmServer, ServedFrame, StreamHeader
from asterism.live.servers.natnet import GROUP
from asterism.live.sinks.lsl import LslSink
from asterism.live.sinks.osc import OscSink
from live_client import EVERY, N_MARKERS, N_POINTS, PERIOD, RATE, sent_frame
from report import conditions, publish, table

if TYPE_CHECKING:
    from collections.abc import Callable

HERE = Path(__file__).resolve().parent
NODE = HERE.parent / "build" / "node"
NAMES = tuple(f"M{i:02d}" for i in range(N_MARKERS))
AHEAD = 15  # frames
QTM = tuple(f"1.{minor}" for minor in range(19, 29))
NATNET = ("3.0", "3.1", "4.0", "4.1")
CLIENTS: dict[str, tuple[str, ...]] = {
    "qtm-rt": QTM,
    "qualisys-rt": QTM,
    "motioncapture": ("1.19",),
    "natnet": (*NATNET, *(f"{v} multicast" for v in NATNET)),
    "natnetsdk": NATNET,
    "pylsl": ("LSL",),
    "python-osc": ("OSC",),
}
MODULES = {"python-osc": "pythonosc", "qtm-rt": "qtm_rt"}


def is_there(client: str) -> bool:
    """Whether a client is installed."""
    if client == "qualisys-rt":
        return shutil.which("node") is not None and (NODE / "node_modules" / client).is_dir()
    return importlib.util.find_spec(MODULES.get(client, client)) is not None


def free_port() -> int:
    """Return a port that is free with the next one."""
    while True:
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
            with contextlib.suppress(OSError), socket.create_server(("127.0.0.1", port + 1)):
                return port


def served(number: int) -> ServedFrame:
    markers, points = sent_frame(number)
    ids = np.arange(N_POINTS) + 1
    return ServedFrame(
        number=number, time=(number - 1) / RATE, markers=markers, points=points, ids=ids
    )


def tracked(number: int) -> LiveFrame:
    """Return a frame as the sinks get it: the markers that are seen."""
    markers, _ = sent_frame(number)
    seen = np.flatnonzero(np.isfinite(markers[:, 0]))
    return LiveFrame(
        number=number, time=(number - 1) / RATE, points=markers[seen], labels=seen,
        names=tuple(NAMES[i] for i in seen), received=time.perf_counter(),
    )  # fmt: skip


def measure(client: str, version: str, n: int, folder: str) -> list[str]:
    """Send all frames to a client; return the row of the table."""
    port = 22223 if client == "motioncapture" else free_port()  # which knows no other
    command = [sys.executable, str(HERE / "live_client.py"), client, str(port), version, str(n)]
    if client == "qualisys-rt":
        script = str(HERE / "live_client.js")
        command = ["node", script, str(NODE), str(port), version, str(n), f"{folder}/frames.json"]
    sender: Any
    make: Callable[[int], Any] = served
    begin: Callable[[], object]
    if client in ("pylsl", "python-osc"):
        is_lsl = client == "pylsl"
        name = f"asterism benchmark {port}"
        sender = LslSink("lsl", name) if is_lsl else OscSink("osc", "127.0.0.1", port)
        sender.open(StreamHeader(source="benchmark", rate=RATE, names=NAMES))
        make = tracked
        begin = (lambda: sender._outlet.wait_for_consumers(30)) if is_lsl else lambda: None
    else:
        if client in ("qtm-rt", "qualisys-rt", "motioncapture"):
            sender = QtmServer(port=port, discovery_port=0, names=NAMES, rate=RATE)
        else:
            major, minor = map(int, version.split()[0].split("."))
            group = GROUP if "multicast" in version else ""
            sender = NatNetServer(
                port=port, names=NAMES, rate=RATE, version=(major, minor), multicast=group,
                data_port=port + 1,
            )  # fmt: skip
        sender.start()
        begin = lambda: sender.wait_for_client(30)  # noqa: E731
    taken, ended = [0], [""]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    ready = threading.Event()

    def listen() -> None:
        assert process.stdout is not None
        for line in process.stdout:
            ready.set()
            if line.startswith("end"):
                ended[0] = line
            elif line.strip().isdecimal():
                taken[0] = int(line)

    listener = threading.Thread(target=listen, daemon=True)
    listener.start()
    begin()
    if client == "python-osc":
        ready.wait(30)
    time.sleep(0.2)
    start = time.perf_counter()
    for number in range(1, n + 1):
        sender.send(make(number))
        while number - taken[0] >= AHEAD + EVERY and process.poll() is None:
            time.sleep(0.0002)
    process.wait(60)
    took = time.perf_counter() - start
    listener.join(10)
    sender.close()
    _, arrived, wrong = (ended[0] or "end 0 0").split()
    different = "not compared" if client == "motioncapture" else wrong
    faults = sum(sender.faults.values())
    return [
        client,
        version,
        f"{n:,}",
        f"{int(arrived):,}",
        different,
        str(faults),
        f"{n / took:,.0f}",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=100_000)
    parser.add_argument("--clients", nargs="+", choices=list(CLIENTS), default=list(CLIENTS))
    parser.add_argument("--markdown", type=Path)
    args = parser.parse_args()
    rows: list[list[str]] = []
    with tempfile.TemporaryDirectory() as folder:
        as_sent = [
            [[row.tolist() if np.isfinite(row[0]) else None for row in (part * 1000).astype("f4")]
             for part in sent_frame(t)]
            for t in range(PERIOD)
        ]  # fmt: skip
        Path(folder, "frames.json").write_text(json.dumps(as_sent))
        for client in args.clients:
            if not is_there(client):
                rows.append([client, "not installed", *[""] * 5])
                continue
            for version in CLIENTS[client]:
                rows.append(measure(client, version, args.frames, folder))
                print(*rows[-1], flush=True)
    head = ["Client", "Version", "Sent", "Received", "Different", "Dropped", "Frames/s"]
    about = "60 markers and 5 other points a frame, over loopback, one client after another"
    foot = f"{about}. At the end: {conditions()}."
    kept = args.markdown.read_text("utf-8").splitlines()[2:] if args.markdown else []
    kept = [[cell.strip() for cell in row.split("|")[1:-1]] for row in kept if row[:1] == "|"]
    rows += [row for row in kept if row[0] not in args.clients]
    rows.sort(key=lambda row: list(CLIENTS).index(row[0]))
    publish([*table(head, rows), "", foot], args.markdown)


if __name__ == "__main__":
    main()
