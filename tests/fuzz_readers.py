"""Feed broken files to every reader: each must give a capture or a FormatError, and soon.

    python tests/fuzz_readers.py 20000

Every input is read in a child process with limits of memory and time, described, and written
again; a crash, a hang, a memory that runs out or any other exception is reported with the input
that caused it, which is kept. The inputs follow from their numbers: a run can be repeated.
"""

# ruff: noqa: T201
from __future__ import annotations

import json
import resource
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from pathlib import Path

import numpy as np

from asterism.errors import AsterismError
from asterism.io import FORMATS, describe, read, write
from asterism.model import Tracks
from c3d_bytes import DEC, SGI, integers, make_c3d, reals, text

MEMORY = 2 << 30
SECONDS = 5


def seeds(folder: Path) -> list[Path]:
    """Write one small valid file of each kind."""
    rng = np.random.default_rng(0)
    dense = rng.normal(size=(12, 5, 3))
    dense[rng.random((12, 5)) < 0.2] = np.nan
    names = ["LASI", "RASI", None, "Ann:T10", "*4"]
    tracks = Tracks.from_dense(np.arange(12) / 100, dense, names)
    made: list[Path] = []
    for name, form in FORMATS.items():
        if form.write is not None:
            made.append(folder / f"seed_{name}{form.extensions[0]}")
            write(tracks, made[-1], format=name)
    points = np.concatenate([dense * 1000, np.zeros((12, 5, 1))], axis=2)
    points[np.isnan(points[..., 0])] = 0, 0, 0, -1
    labels = ["LASI", "LHipAngles", "*2", "", "S:LKNE"]
    more = [
        ("POINT", "ANGLES", *text(["LHipAngles"])),
        ("ANALOG", "USED", 2, (), integers([2])),
        ("ANALOG", "LABELS", *text(["Fx", "Fy"])),
        ("ANALOG", "RATE", 4, (), reals([200])),
        ("EVENT", "TIMES", 4, (2, 2), reals([0, 1, 0, 2])),
        ("TRIAL", "ACTUAL_START_FIELD", 2, (2,), integers([1, 0])),
        ("TRIAL", "ACTUAL_END_FIELD", 2, (2,), integers([12, 0])),
    ]
    analog = rng.integers(-99, 99, size=(12, 4))
    kinds = {
        "float": {"analog": analog, "n_samples": 2, "more": more},
        "integer": {"analog": analog, "n_samples": 2, "scale": 0.1},
        "sgi": {"processor": SGI},
        "dec": {"processor": DEC},
    }
    for name, options in kinds.items():
        made.append(folder / f"seed_{name}.c3d")
        made[-1].write_bytes(make_c3d(points, labels=labels, **options))
    made.append(folder / "seed_motive.csv")
    made[-1].write_text(MOTIVE)
    return made


MOTIVE = """Format Version,1.23,Take Name,a,Export Frame Rate,100.0,Length Units,Meters

,Type,Rigid Body,Rigid Body,Rigid Body,Marker,Marker,Marker,Marker,Marker,Marker
,Name,RB,RB,RB,RB:1,RB:1,RB:1,Unlabeled 7,Unlabeled 7,Unlabeled 7
,ID,"1","1","1","2","2","2","3","3","3"
,,Position,Position,Position,Position,Position,Position,Position,Position,Position
Frame,Time (Seconds),X,Y,Z,X,Y,Z,X,Y,Z
0,0.00,1,2,3,0.1,0.2,0.3,,,
1,0.01,1,2,3,0.1,0.2,0.3,0.5,0.6,0.7
"""


def mutate(raw: bytes, rng: np.random.Generator) -> bytes:
    """Break a file in one to three ways."""
    data = bytearray(raw)
    for _ in range(rng.integers(1, 4)):
        size = max(len(data), 1)
        a, b = sorted(int(i) for i in rng.integers(0, size, 2))
        kind = rng.integers(8)
        # Most of what can go wrong lies in the header: aim there half of the time.
        reach = min(size, 700) if rng.random() < 0.5 else size
        if kind == 0:  # random bytes
            for i in rng.integers(0, reach, rng.integers(1, 17)):
                data[i : i + 1] = bytes([rng.integers(256)])
        elif kind == 1:  # cut off
            del data[a:]
        elif kind == 2:  # two pieces change places
            n = int(min(rng.integers(1, 65), b - a))
            data[a : a + n], data[b : b + n] = data[b : b + n], data[a : a + n]
        elif kind == 3:  # huge, tiny or negative counts
            i = int(rng.integers(reach))
            words = [b"\xff\xff", b"\xff\x7f", b"\0\0", b"\0\x80", b"\xff\xff\xff\xff", b"\1\0"]
            word = words[rng.integers(len(words))]
            data[i : i + len(word)] = word
        elif kind == 4:  # a piece twice
            data[b:b] = data[a : min(b, a + 4096)]
        elif kind == 5:  # a piece lost
            del data[a : min(b, a + int(rng.integers(1, 65)))]
        elif kind == 6:  # words that mean something to a parser of text
            words = [
                b"nan",
                b"inf",
                b"-1",
                b"1e999",
                b"99999999999",
                b"\t",
                b"\n",
                b'"',
                b",",
                b"\0",
            ]
            i = int(rng.integers(reach))
            data[i : i + int(rng.integers(3))] = words[rng.integers(len(words))]
        else:  # a single bit
            i = int(rng.integers(reach))
            data[i : i + 1] = bytes([data[i] ^ (1 << int(rng.integers(8)))] if data else b"")
    return bytes(data)


def try_one(path: Path, out: Path) -> str:
    """Read, describe and write one input; the name of what came of it, or an unexpected error."""
    try:
        capture = read(path)
        describe(capture)
    except AsterismError:
        return "refused"
    try:
        write(capture.tracks, out / f"out{FORMATS[capture.format].extensions[0] or '.log'}")
    except AsterismError:
        return "read, not writable"
    return "read"


def _child(folder: Path, first: int, last: int) -> None:
    warnings.simplefilter("error")
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    made = sorted(folder.glob("seed_*"))
    log = (folder / "log").open("a")
    for i in range(first, last):
        seed = made[i % len(made)]
        path = folder / f"input{seed.suffix}"
        path.write_bytes(mutate(seed.read_bytes(), np.random.default_rng(i)))
        log.write(f'{{"begin": {i}}}\n')
        log.flush()
        signal.alarm(SECONDS)  # unhandled on purpose: it kills even where no Python runs
        began = time.perf_counter()
        try:
            outcome = try_one(path, folder)
        except BaseException:
            outcome = "FAILED " + traceback.format_exc()
            (folder / f"failed_{i}{seed.suffix}").write_bytes(path.read_bytes())
        signal.alarm(0)
        seconds = time.perf_counter() - began
        log.write(json.dumps({"i": i, "kind": seed.name, "is": outcome, "s": seconds}) + "\n")
    log.close()


def main(n: int) -> int:
    """Run `n` inputs; the number of failures."""
    folder = Path(tempfile.mkdtemp(prefix="fuzz_"))
    n_seeds = len(seeds(folder))
    (folder / "log").touch()
    first, died = 0, 0
    while first < n:
        command = [sys.executable, __file__, "--child", str(folder), str(first), str(n)]
        code = subprocess.run(command, check=False).returncode
        if code == 0:
            break
        begun = [e["begin"] for e in map(json.loads, _lines(folder)) if "begin" in e]
        if not begun or begun[-1] < first:
            raise RuntimeError(f"the child does not start, code {code}")
        first, died = begun[-1] + 1, died + 1
        print(f"input {begun[-1]}: the process died, code {code}")
        for path in folder.glob("input*"):
            path.rename(folder / f"died_{begun[-1]}{path.suffix}")
    results = [e for e in map(json.loads, _lines(folder)) if "is" in e]
    failures = [e for e in results if e["is"].startswith("FAILED")]
    for e in failures[:20]:
        print(e["i"], e["kind"], e["is"])
    kinds = [e["is"].split()[0] if e["is"].startswith("FAILED") else e["is"] for e in results]
    outcomes = {kind: kinds.count(kind) for kind in sorted(set(kinds))}
    slowest = max((e["s"] for e in results), default=0.0)
    print(f"{len(results)} inputs from {n_seeds} seeds: {outcomes}")
    print(f"slowest {slowest:.2f} s; {len(failures)} failures, {died} deaths; kept in {folder}")
    return len(failures) + died


def _lines(folder: Path) -> list[str]:
    return (folder / "log").read_text().splitlines()


if __name__ == "__main__":
    if sys.argv[1:2] == ["--child"]:
        _child(Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4]))
    else:
        sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 20_000) > 0)
