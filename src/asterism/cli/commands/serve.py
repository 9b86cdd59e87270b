"""``asterism serve``: a capture or a scene as the stream of a Qualisys or OptiTrack system."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asterism.cli.console import Json, Overwrite, Quiet, print_json, print_table, progress
from asterism.errors import ParameterError

if TYPE_CHECKING:
    import asterism as am

__all__ = ["serve"]


class _System(StrEnum):
    qtm = "qtm"
    natnet = "natnet"


_In = Annotated[
    Path | None, typer.Argument(metavar="[CAPTURE]", help="Capture.", show_default=False)
]
_Scene = Annotated[
    str | None,
    typer.Option(help="Serve a scene instead, one of `asterism scenes`.", show_default=False),
]
_As = Annotated[
    _System, typer.Option("--as", help="Protocol: Qualisys real-time, or OptiTrack NatNet.")
]
_Host = Annotated[
    str, typer.Option(help="Address of the interface; 0.0.0.0 for all of this machine.")
]
_Port = Annotated[
    int | None,
    typer.Option(help="Port.", show_default="22223 for qtm, 1510 for natnet", min=1, max=65534),
]
_Version = Annotated[
    str | None,
    typer.Option(help="Newest version of NatNet: 3.0, 3.1, 4.0 or 4.1.", show_default="4.1"),
]
_Multicast = Annotated[
    str | None,
    typer.Option(metavar="GROUP", help="Multicast group for NatNet.", show_default="unicast"),
]
_Labelled = Annotated[
    bool, typer.Option("--labelled", help="Send the markers with their names and identities.")
]
_Loop = Annotated[bool, typer.Option("--loop", help="Repeat the capture until Ctrl-C.")]
_Frames = Annotated[int | None, typer.Option(help="Frames of the scene.", show_default="its own")]
_Rate = Annotated[
    float | None, typer.Option(help="Frame rate of the scene, Hz.", show_default="its own")
]
_Markers = Annotated[
    int | None, typer.Option(help="Number of markers of the scene.", show_default="its own")
]
_Options = Annotated[
    list[str] | None,
    typer.Option("--option", metavar="NAME=VALUE", help="Option of the scene; may be repeated."),
]
_Corruption = Annotated[
    list[str] | None,
    typer.Option(
        "--corrupt",
        metavar="NAME=VALUE",
        help="Corruption (missing, clutter, noise, burst, ghosts, dropped, jitter …); may be "
        "repeated.",
    ),
]
_Rig = Annotated[
    str | None,
    typer.Option(
        "--rig",
        metavar="RIG",
        help="Serve image points of cameras too, for qtm: a calibration (file or folder), or a "
        "layout such as ring8 or wall4.",
        show_default=False,
    ),
]
_Seeing = Annotated[
    list[str] | None,
    typer.Option(
        "--seeing",
        metavar="NAME=VALUE",
        help="Property of the camera images, as for `asterism film`; may be repeated.",
    ),
]
_Truth = Annotated[
    Path | None,
    typer.Option(
        "--truth", help="File for the points as served, with true names.", show_default=False
    ),
]
_Seed = Annotated[int | None, typer.Option(help="Random seed.", show_default="0")]


def serve(
    capture: _In = None,
    scene: _Scene = None,
    system: _As = _System.qtm,
    host: _Host = "127.0.0.1",
    port: _Port = None,
    version: _Version = None,
    multicast: _Multicast = None,
    labelled: _Labelled = False,
    loop: _Loop = False,
    frames: _Frames = None,
    rate: _Rate = None,
    markers: _Markers = None,
    option: _Options = None,
    corruption: _Corruption = None,
    rig: _Rig = None,
    seeing: _Seeing = None,
    save: _Truth = None,
    seed: _Seed = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Serve a capture or a scene in real time, as Qualisys Track Manager or Motive would.

    The stream begins when the first client asks for frames. By default the points have no labels,
    as those of markers that the system has not identified.

    For example:

        asterism serve walk.c3d

        asterism serve walk.c3d --as natnet --labelled --loop

        asterism serve --scene person --corrupt missing=0.05 --corrupt burst=3 --truth truth.csv

        asterism serve --scene person --rig ring8 --seeing noise_px=0.2
    """
    import asterism as am
    from asterism.cli.options import as_options
    from asterism.cli.outputs import check_outputs
    from asterism.io.captures.files import format_to_write

    if (capture is None) == (scene is None):
        got = "none" if capture is None else "both"
        raise ParameterError("serve", "a capture, or a scene by --scene", got)
    if save is not None:
        with as_options({"path": "--truth"}):
            format_to_write(save, None)
    check_outputs({"--truth": save}, [capture], overwrite=overwrite)
    if rig is None and seeing:
        raise ParameterError("--seeing", "--rig to go with it", "none")
    given = {"frames": frames, "rate": rate, "markers": markers}
    tracks, about = _tracks(
        capture, scene, given, option or [], corruption or [], seed,
        labelled=labelled, is_seeing=bool(seeing),
    )  # fmt: skip
    if save is not None:
        format_to_write(save, None).check(tracks.detections)
    cameras, observations = None, None
    if rig is not None:
        cameras, about["rig"], observations = _filmed(tracks, rig, seeing or [], seed or 0)
    server = _server(system, host, port, version, multicast, cameras)
    if save is not None:
        am.write(tracks, save)

    def begin() -> None:
        address = f"{server.host}:{server.port}"
        record: dict[str, Any] = {"address": address, "protocol": system.value, **about}
        if save is not None:
            record["truth"] = str(save)
        if json:
            print_json(record)
        elif not quiet:
            d = tracks.detections
            rows = [
                (f"{system.value} server", address),
                ("frames", f"{d.n_frames} at {server.rate:g} Hz"),
                ("labelled markers", len(server.names)),
                *([("cameras", about["rig"])] if rig is not None else []),
                *([] if save is None else [("truth", save)]),
                ("stop with", "Ctrl-C"),
            ]
            print_table(rows)

    n_sent = am.live.serve(
        tracks, server, labelled=labelled, observations=observations, loop=loop, begin=begin
    )
    if not (quiet or json):
        missed = ", ".join(f"{n} × {reason}" for reason, n in server.faults.items())
        print_table([("frames sent", n_sent), ("missed by clients", missed or "none")])


def _filmed(
    tracks: am.Tracks, rig: str, seeing: list[str], seed: int
) -> tuple[am.Rig, str, am.camera.Observations]:
    """Return the cameras, their description and their image points of the tracks."""
    from asterism.cli.filming import film_all
    from asterism.cli.recording import rig_from, seeing_from

    points = tracks.detections.points[tracks.labels >= 0]
    if not len(points):
        raise ParameterError("--rig", "points in tracks", "none", "run asterism track first")
    cameras, about = rig_from(rig, points)
    with progress("filming", tracks.detections.n_frames) as advance:
        footage = film_all(tracks, cameras, advance, seeing_from(seeing), seed)
    return cameras, about, footage.observations


def _server(
    system: _System,
    host: str,
    port: int | None,
    version: str | None,
    multicast: str | None,
    rig: am.Rig | None,
) -> am.live.QtmServer | am.live.NatNetServer:
    from asterism.cli.options import as_options
    from asterism.live.servers import natnet, qtm
    from asterism.live.sinks.parse import version_of

    with as_options({name: f"--{name}" for name in ("host", "rig", "version", "multicast")}):
        if system is _System.natnet:
            if rig is not None:
                raise ParameterError("--rig", "--as qtm to go with it", "--as natnet")
            chosen = version_of("version", version or "4.1")
            return natnet.NatNetServer(
                host, port or natnet.PORT, version=chosen, multicast=multicast or ""
            )
        if version is not None or multicast is not None:
            got = "--version" if version is not None else "--multicast"
            raise ParameterError("--as qtm", "no option of NatNet", got)
        return qtm.QtmServer(host, port or qtm.PORT, is_replay=True, rig=rig)


def _tracks(
    capture: Path | None,
    scene: str | None,
    given: dict[str, Any],
    options: list[str],
    corruption: list[str],
    seed: int | None,
    *,
    labelled: bool,
    is_seeing: bool,
) -> tuple[am.Tracks, dict[str, Any]]:
    """Read the capture or make the scene, and corrupt it."""
    import asterism as am
    from asterism.cli.options import as_options
    from asterism.cli.recording import made_scene, switches_from

    switches = switches_from(corruption)
    is_mixed = bool(switches) or not labelled  # the order of the points would show their labels
    if scene is not None:
        tracks, values = made_scene(scene, given | {"seed": seed}, options)
        about: dict[str, Any] = {"scene": scene, "options": values}
    else:
        assert capture is not None
        own = {f"--{name}": value for name, value in given.items()} | {"--option": options or None}
        if found := [name for name, value in own.items() if value is not None]:
            raise ParameterError("CAPTURE", "no option of a scene", ", ".join(found))
        tracks, about = am.io.read_tracks(capture), {"input": str(capture)}
        if seed is not None and not (is_mixed or is_seeing):
            raise ParameterError("--seed", "--corrupt or --seeing to go with it", "none")
    if is_mixed:
        with as_options({name: f"--corrupt {name}" for name in switches} | {"seed": "--seed"}):
            tracks = am.simulate.corrupt(tracks, **switches, keep_unnamed=True, seed=seed or 0)
        if switches:
            about["corruption"] = tracks.record
    return tracks, about
