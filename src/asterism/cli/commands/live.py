"""``asterism live``: identities for a stream, frame by frame."""

from __future__ import annotations

import math
import signal
import threading
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asterism.checks import check_number
from asterism.cli.console import Json, Overwrite, Quiet, console, print_json, print_table

if TYPE_CHECKING:
    from collections.abc import Generator

    import asterism as am

__all__ = ["live"]

_From = Annotated[
    str,
    typer.Argument(
        metavar="FROM",
        help="Source: qtm://HOST, or qtm://HOST?2d for its image points, natnet://HOST, "
        "lsl://NAME, udp://:PORT, - for standard input, or a capture to replay, trial.c3d?speed=2.",
    ),
]
_To = Annotated[
    list[str] | None,
    typer.Option(
        "--to",
        metavar="SINK",
        help="Sink: qtm://:PORT, natnet://:PORT, lsl://NAME, osc://HOST:PORT, udp://HOST:PORT, "
        "page://:PORT, - for standard output, or a file to record, out.c3d, out.jsonl, out.csv; "
        "may be repeated.",
    ),
]
_Markers = Annotated[
    list[Path] | None,
    typer.Option(
        "--markers",
        metavar="SET",
        help="Marker set that names the tracks, one for each subject; or learn, for a set of the "
        "names M1, M2, … from the first five seconds.",
    ),
]
_Model = Annotated[
    Path | None, typer.Option(help="Model, TOML.", show_default="estimated from the stream")
]
_Method = Annotated[
    str | None,
    typer.Option(
        help="Method whose tracklets are stitched, one of `asterism methods`.",
        show_default="smp over three frames",
    ),
]
_Options = Annotated[
    list[str] | None,
    typer.Option("--option", metavar="NAME=VALUE", help="Option of the method; may be repeated."),
]
_Seed = Annotated[int | None, typer.Option(help="Random seed, for mcmcda.", show_default="0")]


def live(
    source: _From,
    to: _To = None,
    markers: _Markers = None,
    model: _Model = None,
    method: _Method = None,
    option: _Options = None,
    seed: _Seed = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    r"""Track a stream frame by frame, and pass it on with identities and names.

    Without a model, one is estimated from the first two seconds and refined while the stream runs.
    Ctrl-C ends the stream: files are finished and the counts are printed.

    For example:

        asterism live qtm://192.168.0.10 --to qtm://:22224 --markers subject.toml

        asterism live natnet://192.168.0.10 --to natnet://:1511 --to recording.c3d

        asterism live udp://:5000 --to page://:8000

        asterism live trial.c3d?speed=max --to tracked.csv
    """
    from asterism.cli.commands.track import made_method
    from asterism.cli.outputs import check_ending, check_outputs, read_model
    from asterism.live import run
    from asterism.live.sinks.page import PageSink
    from asterism.live.sinks.parse import parse_sink
    from asterism.tracking import Stitched
    from asterism.tracking.naming.from_file import read_markers

    check_number("--seed", seed or 0, above=0, closed=True, integer=True)
    chosen = made_method(method, option or [])
    files = {text: Path(text) for text in to or [] if "://" not in text and text != "-"}
    for path in files.values():
        check_ending("--to", path, ".c3d", ".csv", ".jsonl")
    replayed = None if "://" in source or source == "-" else Path(source.partition("?")[0])
    check_outputs(
        {f"--to {text}": path for text, path in files.items()},
        [replayed, model, *(markers or [])], overwrite=overwrite,
    )  # fmt: skip
    sinks = [parse_sink(text) for text in to or []]
    tracking_model = None if model is None else read_model(model)
    learns = [str(each) for each in markers or []] == ["learn"]
    sets = "learn" if learns else [read_markers(each) for each in markers or []]
    # Standard output may be a sink.
    prints = not (quiet or json) and "-" not in (to or [])
    for sink in sinks:
        if isinstance(sink, PageSink):
            sink.on_address = _print_address
    for path in files.values():
        path.unlink(missing_ok=True)
    with _stop_signals() as stop, _status(quiet=quiet or json) as status:
        result = run(
            source,
            sinks,
            method=None if chosen is None else Stitched(method=chosen),
            model=tracking_model,
            marker_set=sets,
            seed=seed,
            stop=stop,
            status=status,
        )
    if json:
        numbers = {k: v if math.isfinite(v) else None for k, v in result.info.items()}
        learnt = None if result.model is None else result.model.to_dict()
        print_json({"source": source, "sinks": to or [], **numbers, "model": learnt})
    elif prints:
        print_table(_rows(result), title="Stream")


def _print_address(address: str) -> None:
    console(stderr=True).print(f"page: {address}", markup=False, soft_wrap=True)


def _milliseconds(seconds: float) -> str:
    value = 1e3 * seconds
    return f"{value:,.0f} ms" if value >= 100 else f"{value:.3g} ms"


def _rows(run: am.live.LiveRun) -> list[tuple[str, str]]:
    from asterism.live.loop import FIRST_SECONDS

    info = run.info
    no_model = f"none: estimated from the first {FIRST_SECONDS:g} s; a shorter stream needs --model"
    latency = ", ".join(
        f"{name} {_milliseconds(info[f'latency_{key}'])}"
        for key, name in (("median", "median"), ("p99", "99 %"), ("p999", "99.9 %"))
    )
    return [
        ("frames", f"{run.n_frames:,} at {run.rate:.4g} Hz"),
        ("tracks", f"{run.n_tracks}, {run.n_names} with a name"),
        *([] if run.n_models else [("model", no_model)]),
        ("latency", latency if run.n_frames else "–"),
        *((kind, f"{n:,}") for kind, n in (run.faults or {}).items()),
    ]


@contextmanager
def _stop_signals() -> Generator[threading.Event, None, None]:
    """Set an event at SIGINT or SIGTERM; a second signal has its usual effect."""
    stop = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return
    known = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    before = {number: handler for number, handler in known.items() if handler != signal.SIG_IGN}

    def end(signum: int, frame: Any) -> None:
        del signum, frame
        stop.set()
        for number, handler in before.items():
            signal.signal(number, handler)

    try:
        for number in before:
            signal.signal(number, end)
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def _status(*, quiet: bool) -> Generator[Any, None, None]:
    """Show the counts in one line on a terminal."""
    screen = console(stderr=True)
    if quiet or not screen.is_terminal:
        yield None
        return
    with screen.status("waiting for frames") as line:

        def show(run: am.live.LiveRun) -> None:
            info = run.info
            median, late = (1e3 * info[f"latency_{key}"] for key in ("median", "p99"))
            learnt = "" if run.model is not None else ", estimating the model"
            line.update(
                f"{run.n_frames:,} frames, {run.rate:.1f} Hz, {run.n_tracks} tracks, "
                f"{run.n_names} named, {median:.2g} ms, 99 % {late:.2g} ms, "
                f"{sum((run.faults or {}).values()):,} faults{learnt}"
            )

        yield show
