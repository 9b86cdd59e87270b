"""Feed damaged files to every reader: each must give a result or an error of the project, and soon.

    python -m tests.tools.fuzz_readers                # 20 000 inputs for each reader
    python -m tests.tools.fuzz_readers trc c3d --count 1000000 --state /tmp/fuzz

`fuzzing.py` runs them, with limits of memory and of time, and keeps each input that fails.
"""

from __future__ import annotations

import contextlib
import random
import re
import struct
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import asterism as am
from asterism.errors import AsterismError
from asterism.io import CAPTURE_FORMATS, describe, read, write
from asterism.io.calibrations import CALIBRATION_FORMATS, read_rig, write_rig
from asterism.io.calibrations.points import read_sightings
from asterism.io.observations import read_observations, write_observations
from asterism.model import Tracks
from asterism.multiview.rig_check import check_rig
from asterism.multiview.rig_info import describe_rig
from tests.io.c3d_bytes import DEC, SGI, integers, make_c3d, reals, text
from tests.io.calibrations.rigs import NAMES, rig_for
from tests.io.marker_sets.models import model
from tests.tools import fuzzing

if TYPE_CHECKING:
    from collections.abc import Callable

LOOKED_AT = 8  # one in so many of the files that were read is described and written as well
SNIFFED = 8  # one in so many is read by its content

MOTIVE = """Format Version,1.23,Take Name,a,Export Frame Rate,100.0,Length Units,Meters

,Type,Rigid Body,Rigid Body,Rigid Body,Marker,Marker,Marker,Marker,Marker,Marker
,Name,RB,RB,RB,RB:1,RB:1,RB:1,Unlabeled 7,Unlabeled 7,Unlabeled 7
,ID,"1","1","1","2","2","2","3","3","3"
,,Position,Position,Position,Position,Position,Position,Position,Position,Position
Frame,Time (Seconds),X,Y,Z,X,Y,Z,X,Y,Z
0,0.00,1,2,3,0.1,0.2,0.3,,,
1,0.01,1,2,3,0.1,0.2,0.3,0.5,0.6,0.7
"""
XY = """sync_index,cam_id,frame_index,frame_time,point_id,img_loc_x,img_loc_y,obj_loc_x,obj_loc_y
4,0,4,7.5,1,100.25,200.5,0.1,0.05
4,0,4,7.5,3,110.25,210.5,,
4,2,3,7.51,1,300.125,20.5,0.1,0.05
6,2,5,7.55,3,301.125,21.5,0.1,0.1
"""


@dataclass(frozen=True)
class Reader:
    """What is fuzzed: valid files, each a name and its content, and what reads them.

    `read` gives the result and what else may be done with it, which must not fail either. A seed of
    several files is a folder, of which one file is damaged.
    """

    seeds: tuple[dict[str, bytes], ...]
    read: Callable[[Path, bool], Callable[[Path], None]]


def _capture_seeds(name: str) -> tuple[dict[str, bytes], ...]:
    rng = np.random.default_rng(0)
    dense = rng.normal(size=(4, 5, 3))
    dense[rng.random((4, 5)) < 0.2] = np.nan
    tracks = Tracks.from_dense(np.arange(4) / 100, dense, ["LASI", "RASI", None, "Ann:T10", "*4"])
    ending = CAPTURE_FORMATS[name].extensions[0]
    made: list[dict[str, bytes]] = []
    if CAPTURE_FORMATS[name].write is not None:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"seed{ending}"
            write(tracks, path, format=name)
            made.append({path.name: path.read_bytes()})
    if name == "motive":
        made.append({"seed.csv": MOTIVE.encode()})
    if name in ("csv", "csv-wide"):  # with its last column, and with blanks and quotes
        (seed,) = made
        lines = next(iter(seed.values())).decode().splitlines()
        units = [f"{line},{'mm' if i else 'source_unit'}" for i, line in enumerate(lines)]
        made.append({"seed.csv": "\n".join(units).encode()})
    if name == "c3d":
        points = np.concatenate([dense * 1000, np.zeros((4, 5, 1))], axis=2)
        points[np.isnan(points[..., 0])] = 0, 0, 0, -1
        labels = ["LASI", "LHipAngles", "*2", "", "S:LKNE"]
        more = [
            ("POINT", "ANGLES", *text(["LHipAngles"])),
            ("ANALOG", "USED", 2, (), integers([2])),
            ("ANALOG", "LABELS", *text(["Fx", "Fy"])),
            ("ANALOG", "RATE", 4, (), reals([200])),
            ("EVENT", "TIMES", 4, (2, 2), reals([0, 1, 0, 2])),
            ("TRIAL", "ACTUAL_START_FIELD", 2, (2,), integers([1, 0])),
            ("TRIAL", "ACTUAL_END_FIELD", 2, (2,), integers([4, 0])),
        ]
        analog = rng.integers(-99, 99, size=(4, 4))
        kinds = (
            {"analog": analog, "n_samples": 2, "more": more},
            {"analog": analog, "n_samples": 2, "scale": 0.1},
            {"processor": SGI},
            {"processor": DEC},
        )
        made += [{"seed.c3d": make_c3d(points, labels=labels, **options)} for options in kinds]
    return tuple(made)


def _read_capture(name: str) -> Callable[[Path, bool], Callable[[Path], None]]:
    ending = CAPTURE_FORMATS[name].extensions[0]

    def _read(path: Path, is_sniffed: bool) -> Callable[[Path], None]:
        capture = read(path, format=None if is_sniffed else name)

        def look(folder: Path) -> None:
            describe(capture)
            with contextlib.suppress(AsterismError):
                write(capture.tracks, folder / f"out{'.c3d' if name == 'motive' else ending}")

        return look

    return _read


def _rig_seeds(name: str) -> tuple[dict[str, bytes], ...]:
    made: list[dict[str, bytes]] = []
    for is_bent in (True, False):
        rig = rig_for(name, bent=is_bent)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / NAMES[name]
            few = rig.cameras[: 1 if name == "opencv" else 2]  # YAML is read slowly
            write_rig(am.Rig(few), path, format=name)
            files = sorted(path.iterdir()) if path.is_dir() else [path]
            made.append({file.name: file.read_bytes() for file in files})
    if name == "caliscope":
        rows = rb"rotation = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]"
        (content,) = made[0].values()
        made.append({"a.toml": re.sub(rb"rotation = \[.*\]", rows, content)})
    return tuple(made)


def _read_rig(name: str) -> Callable[[Path, bool], Callable[[Path], None]]:
    def _read(path: Path, is_sniffed: bool) -> Callable[[Path], None]:
        rig = read_rig(path, format=None if is_sniffed else name)

        def look(folder: Path) -> None:
            for camera in rig:
                assert np.isfinite(camera.T_camera_world).all()
                assert np.isfinite(camera.K).all()
            describe_rig(rig)
            check_rig(rig)
            with contextlib.suppress(AsterismError):
                write_rig(rig, folder / "again.toml")
                read_rig(folder / "again.toml")

        return look

    return _read


def _read_points(path: Path, _: bool) -> Callable[[Path], None]:
    seen = read_observations(path)

    def look(folder: Path) -> None:
        with contextlib.suppress(AsterismError):
            write_observations(seen, folder / "out.csv")

    return look


def _observation_seeds() -> tuple[dict[str, bytes], ...]:
    seen = am.Observations(
        times=[0.0, 0.01, 0.02], cameras=("a", "b"), offsets=[0, 2, 3, 3, 3, 4, 6],
        pixels=np.arange(12.0).reshape(6, 2) * 7.25, markers=[0, 1, 1, -1, 0, 1],
        marker_names=("LASI", "R, ASI"),
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        write_observations(seen, Path(folder) / "o.csv")
        return ({"o.csv": (Path(folder) / "o.csv").read_bytes()},)


def _read_known_points(path: Path, _: bool) -> Callable[[Path], None]:
    read_sightings(path, ["cam1", "cam2"], camera=None if b"," in path.read_bytes() else "cam1")
    return lambda folder: None


def _marker_set() -> bytes:
    points = np.random.default_rng(1).normal(size=(1, 4, 3)).repeat(24, axis=0)
    tracks = Tracks.from_dense(np.arange(24) / 100, points, "ABCD")
    return am.learn_marker_set(tracks).to_toml().encode()


def _marker_set_seeds() -> tuple[dict[str, bytes], ...]:
    return (
        {"a.toml": _marker_set()},
        *(
            {name: model(version=version).encode()}
            for name, version in (("a.vsk", "2.5"), ("a.vst", "3.2"))
        ),
    )


def _read_marker_set(path: Path, _: bool) -> Callable[[Path], None]:
    made = am.io.read_marker_set(path)

    def look(folder: Path) -> None:
        made.to_toml(folder / "out.toml")
        am.io.read_marker_set(folder / "out.toml")

    return look


def _sightings() -> tuple[dict[str, bytes], ...]:
    return (
        {"points.csv": b"camera,x,y,z,u,v\ncam1,1,2,3,4.5,5\ncam2,1e-3,2,3,4,5\n"},
        {"cam1.dat": b"1 2 3 1 4.5 5 1\n-1e3 2 3 1 4 5 1\n"},
        {"cam1_cal": b"4.5 5 1 2 3\n4 5 -1e3 2 3\n"},
    )


def readers() -> dict[str, Callable[[], Reader]]:
    """Give what makes each reader, by its name."""
    made: dict[str, Callable[[], Reader]] = {}
    for name in CAPTURE_FORMATS:
        made[name] = lambda name=name: Reader(_capture_seeds(name), _read_capture(name))
    for name in CALIBRATION_FORMATS:
        made[f"rig-{name}"] = lambda name=name: Reader(_rig_seeds(name), _read_rig(name))
    made["observations"] = lambda: Reader(_observation_seeds(), _read_points)
    made["caliscope-xy"] = lambda: Reader(({"xy.csv": XY.encode()},), _read_points)
    made["sightings"] = lambda: Reader(_sightings(), _read_known_points)
    made["marker-set"] = lambda: Reader(_marker_set_seeds(), _read_marker_set)
    return made


WORDS = (b"nan", b"inf", b"-inf", b"-1", b"0", b"1e999", b"1e300", b"-1e-300", b"99999999999",
         b"99999999999999999999", b"9" * 400, b"", b"x", b"0x1", b"1_0", b"1e5", b"true", b"[]",
         b"'", b'"', b",", b"\t", b"\n", b"\r", b"\0", b" ", b"\xff", b"\xef\xbb\xbf",
         "\u0663".encode())  # fmt: skip
EXTREMES = (
    *(struct.pack("<H", n) for n in (0, 1, 2, 255, 0x7FFF, 0x8000, 0xFFFF)),
    *(struct.pack("<I", n) for n in (0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)),
    *(struct.pack("<f", x) for x in (np.nan, np.inf, -np.inf, 1e38, -1e38, 1e-45, 1e10)),
)
_NUMBER = re.compile(rb"-?\d+(?:\.\d*)?(?:e[-+]?\d+)?")


def damage(raw: bytes, rng: random.Random, others: tuple[bytes, ...] = ()) -> bytes:
    """Damage a file in one to three ways: as bytes, as numbers, as lines."""
    data = bytearray(raw)
    for _ in range(rng.choice((1, 1, 2, 3))):
        kind = rng.randrange(12)
        size = max(len(data), 1)
        # Most of what can go wrong lies in the header: aim there half of the time.
        reach = min(size, 700) if rng.random() < 0.5 else size
        a, b = sorted((rng.randrange(size), rng.randrange(size)))
        i = rng.randrange(reach)
        if kind == 0:  # random bytes
            for _ in range(rng.randint(1, 16)):
                at = rng.randrange(reach)
                data[at : at + 1] = bytes([rng.randrange(256)])
        elif kind == 1:  # a single bit
            data[i : i + 1] = bytes([data[i] ^ (1 << rng.randrange(8))] if data else b"")
        elif kind == 2:  # cut off
            del data[a:]
        elif kind == 3:  # two pieces change places
            n = min(rng.randint(1, 64), b - a)
            data[a : a + n], data[b : b + n] = data[b : b + n], data[a : a + n]
        elif kind == 4:  # counts and reals beyond those of any real file
            word = rng.choice(EXTREMES)
            i -= i % 2 if rng.random() < 0.8 else 0
            data[i : i + len(word)] = word
        elif kind == 5:  # a piece twice
            data[b:b] = data[a : min(b, a + 4096)]
        elif kind == 6:  # a piece lost
            del data[a : min(b, a + rng.randint(1, 64))]
        elif kind == 7:  # something new
            data[i:i] = rng.randbytes(rng.randint(1, 16))
        elif kind == 8:  # words that mean something to a parser of text
            data[i : i + rng.randrange(3)] = rng.choice(WORDS)
        elif kind == 9:  # a number that is another
            numbers = list(_NUMBER.finditer(data))
            if numbers:
                match, other = rng.choice(numbers), rng.choice(numbers)
                word = other[0] if rng.random() < 0.5 else rng.choice(WORDS)
                data[match.start() : match.end()] = word
        elif kind == 10:  # lines in another order, twice, or lost
            lines = data.splitlines(keepends=True)
            if lines:
                p, q = rng.randrange(len(lines)), rng.randrange(len(lines))
                lines[p : p + rng.randrange(2)] = lines[q : q + rng.randrange(3)]
            data = bytearray(b"".join(lines))
        else:  # spliced with another file
            other = rng.choice(others) if others else raw
            data[a:] = other[rng.randrange(len(other) + 1) :]
    return bytes(data)


class Bench:
    """One reader in a folder of its own, to be fed with inputs by number."""

    def __init__(self, name: str, folder: Path, seed: int = 0) -> None:
        self.name, self.folder, self.seed = name, folder, seed
        self.reader = readers()[name]()
        self.homes: list[Path] = []
        contents = [content for files in self.reader.seeds for content in files.values()]
        self.contents = tuple(contents)
        for n, files in enumerate(self.reader.seeds):
            home = folder / f"seed{n}"
            home.mkdir()
            for file, content in files.items():
                (home / file).write_bytes(content)
            self.homes.append(home)

    def damaged(self, i: int) -> tuple[int, str, bytes, random.Random]:
        """Make input `i`: which seed, which of its files, and its new content."""
        rng = random.Random(f"{self.name} {self.seed} {i}")
        n = i % len(self.homes)
        file = rng.choice(list(self.reader.seeds[n]))
        return n, file, damage(self.reader.seeds[n][file], rng, self.contents), rng

    def feed(self, n: int, file: str, content: bytes, rng: random.Random) -> str:
        """Read one input; what came of it. Anything but an error of the project gets out."""
        home, files = self.homes[n], self.reader.seeds[n]
        (home / file).write_bytes(content)
        path = home if len(files) > 1 else home / file
        try:
            look = self.reader.read(path, rng.randrange(SNIFFED) == 0)
        except AsterismError as error:
            if "\n" in str(error):
                raise AssertionError("a message of more than one line") from error
            return "refused"
        finally:
            (home / file).write_bytes(files[file])
        if rng.randrange(LOOKED_AT) == 0:
            look(self.folder)
        return "accepted"

    def prepare(self) -> None:
        """Read the undamaged files, which loads all modules."""
        for files, home in zip(self.reader.seeds, self.homes, strict=True):
            path = home if len(files) > 1 else home / next(iter(files))
            for is_sniffed in (False, True):
                self.reader.read(path, is_sniffed)(self.folder)

    def kept(self, made: tuple[int, str, bytes, random.Random]) -> tuple[str, bytes]:
        """Name and content of a file that repeats the input."""
        return made[1], made[2]


if __name__ == "__main__":
    sys.exit(fuzzing.main(__doc__, Bench, list(readers()), ["-m", __spec__.name]))
