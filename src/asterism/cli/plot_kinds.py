"""Kinds of figures of ``asterism plot``, with the inputs of each."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from asterism.cli.plot_inputs import (
    confident_tracks,
    is_observations,
    model_for,
    named,
    segments_of,
    selected,
    solid_tracks,
    summary_of,
    tracks_of,
)
from asterism.errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import asterism as am

__all__ = ["KINDS", "Kind", "Request"]


@dataclass(frozen=True, kw_only=True)
class Request:
    """Options of the command, one field each."""

    files: Sequence[Path]
    truth: Path | None = None
    rig: str | None = None
    model: Path | None = None
    frame: int | None = None
    camera: str | None = None
    moves: Sequence[float] | None = None
    seeds: int | None = None
    markers: Sequence[str] | None = None
    time: tuple[float, float] | None = None
    by_time: bool | None = None

    @property
    def file(self) -> Path:
        """Input of kinds that have a single one."""
        return self.files[0]

    def tracks(self) -> am.Tracks:
        """Read the selected markers and times of the file."""
        return selected(tracks_of(self.file), self.markers, self.time)


@dataclass(frozen=True, kw_only=True)
class Kind:
    """One kind of figure.

    Parameters
    ----------
    about : str
        Text of the help.
    draw : callable
        Function of a `Request` that returns a figure or its axes.
    many : bool
        Whether several files are allowed.
    needs, takes : frozenset of str
        Required options, and optional ones.
    """

    about: str
    draw: Callable[[Request], Any]
    many: bool = False
    needs: frozenset[str] = field(default_factory=frozenset[str])
    takes: frozenset[str] = field(default_factory=frozenset[str])


def _trajectories(asked: Request) -> Any:
    import asterism as am

    tracks = asked.tracks()
    segments = None if asked.by_time else segments_of(tracks)
    return am.plot.plot_trajectories(tracks, segments=segments)


def _axes(asked: Request) -> Any:
    import asterism as am

    tracks = asked.tracks()
    return am.plot.plot_axes(tracks, segments=segments_of(tracks))


def _presence(asked: Request) -> Any:
    import asterism as am

    return am.plot.plot_presence(asked.tracks())


def _confidence(asked: Request) -> Any:
    import asterism as am

    tracks = selected(confident_tracks(asked.file), asked.markers, asked.time)
    return am.plot.plot_confidence(tracks)


def _identity(asked: Request) -> Any:
    import asterism as am

    tracks = confident_tracks(asked.file, "identity_confidence")
    return am.plot.plot_identity(selected(tracks, asked.markers, asked.time))


def _errors(asked: Request) -> Any:
    import asterism as am
    from asterism.cli.outputs import truth_of_each

    tracks = tracks_of(asked.file)
    return am.plot.plot_errors(tracks, truth_of_each(tracks, _truth(asked)))


def _reliability(asked: Request) -> Any:
    import asterism as am
    from asterism.cli.outputs import truth_of_each
    from asterism.metrics import CalibrationCurve, calibration_curve, right_identities, right_links
    from asterism.plot.style import new_panels

    truth = _truth(asked)
    links: dict[str, CalibrationCurve] = {}
    identities: dict[str, CalibrationCurve] = {}
    for name, file in named(asked.files).items():
        tracks = confident_tracks(file)
        markers = truth_of_each(tracks, truth).labels
        of_each = (
            (links, tracks.confidence, right_links),
            (identities, tracks.identity_confidence, right_identities),
        )
        for parts, confidence, right_of in of_each:
            if confidence is not None:
                which, is_right = right_of(tracks.labels, markers)
                parts[name] = calibration_curve(confidence[which], is_right)
    drawn = {"confidence of a link": links, "confidence of an identity": identities}
    drawn = {title: parts for title, parts in drawn.items() if parts}
    panels: list[Any] = new_panels(1, len(drawn), width=6.0 * len(drawn), height=6.0)
    for axes, (title, parts) in zip(panels, drawn.items(), strict=True):
        am.plot.plot_reliability(parts, axes)
        axes.set_xlabel(title)
    return panels


def _compare(asked: Request) -> Any:
    import asterism as am

    truth = _truth(asked)
    scores: dict[str, am.metrics.Evaluation] = {}
    times: dict[str, float] = {}
    for name, file in named(asked.files).items():
        scores[name] = am.evaluate(tracks_of(file), truth)
        pace = summary_of(file).get("frames_per_second")
        if pace:
            times[name] = 1e3 / float(pace)
    return am.plot.plot_compare(scores, milliseconds=times)


def _projections(asked: Request) -> Any:
    import asterism as am
    from asterism.cli.recording import rig_from

    if is_observations(asked.file):
        seen = am.io.read_observations(asked.file)
        # Layouts are placed around 3-D points, which image points do not have.
        rig = am.read_rig(Path(asked.rig or ""))
    else:
        from asterism.cli.console import progress
        from asterism.cli.filming import film_all

        truth = solid_tracks(asked.file)
        rig, _ = rig_from(asked.rig or "", truth.detections.points[truth.labels >= 0])
        with progress("filming", truth.detections.n_frames) as advance:
            seen = film_all(truth, rig, advance).observations
    return am.plot.plot_projections(seen, rig)


def _image(asked: Request) -> Any:
    import asterism as am
    from asterism.cli.film_pictures import contact_sheet
    from asterism.cli.recording import rig_from

    truth = solid_tracks(asked.file)
    rig, _ = rig_from(asked.rig or "", truth.detections.points[truth.labels >= 0])
    d = truth.detections
    first = d.first_frame if isinstance(d, am.Capture) else 0
    frame = first + d.n_frames // 2 if asked.frame is None else asked.frame
    if not first <= frame < first + d.n_frames:
        raise ParameterError("--frame", f"{first} to {first + d.n_frames - 1}", frame)
    t = frame - first
    title = f"{asked.file.name}, frame {frame}, {d.times[t]:.3f} s"
    return contact_sheet(truth, rig, t, title)


def _posterior(asked: Request) -> Any:
    import asterism as am
    from asterism.cli.console import progress

    capture = am.read(asked.file).measured()
    model = model_for(asked.model, capture)
    moves = sorted(set(asked.moves or (0.3, 1, 3, 10, 30, 100)))
    seeds = asked.seeds or 3
    values: list[list[float]] = []
    with progress("sampling", seeds * len(moves)) as advance:
        for seed in range(seeds):
            values.append([])
            for n in moves:
                # end_odds=1 searches the posterior that is drawn; a confidence is not needed.
                method = am.MCMCDA(moves=n, confidence=0, end_odds=1)
                found = am.track(capture, method, model=model, seed=seed)
                values[-1].append(found.info["log_posterior"])
                advance(sum(map(len, values)))
    others = {"gnn": am.track(capture, am.GNN(), model=model).info["log_posterior"]}
    return am.plot.plot_posterior(moves, values, others=others)


def _groups(asked: Request) -> Any:
    import asterism as am

    tracks = tracks_of(asked.file)
    return am.plot.plot_groups(
        am.filter.gate_groups(tracks, model_for(asked.model, tracks.detections))
    )


def _rig(asked: Request) -> Any:
    import asterism as am

    return am.plot.plot_rig(am.read_rig(asked.file))


def _lens(asked: Request) -> Any:
    import asterism as am
    from asterism.checks import check_fields

    rig = am.read_rig(asked.file)
    name = asked.camera or rig.names[0]
    check_fields("--camera", [name], rig.names)
    axes: Any = am.plot.plot_lens(rig[rig.names.index(name)])
    axes.set_title(f"{name}: {axes.get_title(loc='left')}", loc="left", parse_math=False)
    return axes


def _truth(asked: Request) -> am.Tracks:
    import asterism as am

    assert asked.truth is not None
    return am.io.read_tracks(asked.truth)


_TRUTH, _RIG = frozenset({"truth"}), frozenset({"rig"})
_MODEL = frozenset({"model"})
_PART = frozenset({"markers", "time"})

KINDS: dict[str, Kind] = {
    "trajectories": Kind(
        about="paths of the tracks in space, coloured by rigid segment",
        draw=_trajectories, takes=_PART | {"by_time"},
    ),
    "axes": Kind(
        about="x, y and z of the tracks over time, coloured by rigid segment",
        draw=_axes, takes=_PART,
    ),
    "presence": Kind(
        about="frames with a detection of each track, and the clutter", draw=_presence, takes=_PART
    ),
    "confidence": Kind(
        about="as presence, shaded by the confidence of each link", draw=_confidence, takes=_PART
    ),
    "identity": Kind(
        about="as presence, shaded by the confidence of each identity",
        draw=_identity, takes=_PART,
    ),
    "errors": Kind(about="wrong labels of each track, over time", draw=_errors, needs=_TRUTH),
    "reliability": Kind(
        about="share of right links and identities by confidence, of one or more results",
        draw=_reliability, many=True, needs=_TRUTH,
    ),
    "compare": Kind(
        about="IDF1, switches and (of run folders) time per frame, of one or more results",
        draw=_compare, many=True, needs=_TRUTH,
    ),
    "projections": Kind(
        about="image points of a capture or of observations, in every camera",
        draw=_projections, needs=_RIG,
    ),
    "image": Kind(
        about="image of every camera in one frame of a capture",
        draw=_image, needs=_RIG, takes=frozenset({"frame"}),
    ),
    "posterior": Kind(
        about="log posterior of mcmcda by number of moves, compared with gnn",
        draw=_posterior, takes=_MODEL | {"moves", "seeds"},
    ),
    "groups": Kind(
        about="sizes of the groups of tracks with common gated detections, over time",
        draw=_groups, takes=_MODEL,
    ),
    "rig": Kind(about="positions and views of the cameras of a calibration", draw=_rig),
    "lens": Kind(
        about="distortion of a square grid by the lens of a camera",
        draw=_lens, takes=frozenset({"camera"}),
    ),
}  # fmt: skip
"""Kinds by name; the function of a kind is `am.plot.plot_KIND`."""
