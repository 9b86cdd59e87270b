"""Result of a stream."""

from __future__ import annotations

from typing import TYPE_CHECKING

from asterism.records import record

if TYPE_CHECKING:
    from collections.abc import Mapping

    from asterism.live.latency import LatencyHistogram
    from asterism.model import TrackingModel

__all__ = ["LiveRun"]


@record(eq=False)
class LiveRun:
    """Counts of a stream, while it runs and at its end.

    Parameters
    ----------
    source : str
        Source, as the user wrote it.
    n_frames : int
        Number of tracked frames.
    n_tracks : int
        Number of present tracks, occluded ones included.
    n_names : int
        Number of named tracks.
    rate : float
        Frame rate of the source, Hz; nan while it is unknown.
    latency : LatencyHistogram
        Time from the reception of a frame until all sinks have it.
    drift : float
        Seconds that this machine's clock gains in a second of the source; nan if unknown.
    faults : mapping of str to int
        Number of occurrences by kind: ``lost``, ``repeated`` and ``reordered`` frames, ``late``
        frames that were dropped because tracking fell behind, ``bad_points``, ``bad_times``,
        ``crowded``, ``too_dense``, ``restarts``, ``clock_jumps``, ``disconnects``, ``pauses``; and
        those that source and sinks count themselves, by their name.
    model : TrackingModel, optional
        Model in use; None before the first estimate.
    n_models : int
        Number of models so far: 1, and one more for each refinement.

    Examples
    --------
    >>> run = LiveRun(source="udp://127.0.0.1:5000")
    >>> run, run.info["frames"]
    (LiveRun('udp://127.0.0.1:5000': 0 frames, 0 tracks), 0)
    """

    source: str
    n_frames: int = 0
    n_tracks: int = 0
    n_names: int = 0
    rate: float = float("nan")
    latency: LatencyHistogram | None = None
    drift: float = float("nan")
    faults: Mapping[str, int] | None = None
    model: TrackingModel | None = None
    n_models: int = 0

    def __repr__(self) -> str:
        return f"LiveRun({self.source!r}: {self.n_frames} frames, {self.n_tracks} tracks)"

    @property
    def info(self) -> dict[str, float]:
        """All numbers by name; latencies in seconds."""
        numbers: dict[str, float] = {
            "frames": self.n_frames, "tracks": self.n_tracks, "names": self.n_names,
            "rate": self.rate, "drift": self.drift, "models": self.n_models,
        }  # fmt: skip
        if self.latency is not None:
            quantiles = {"median": 0.5, "p99": 0.99, "p999": 0.999}
            numbers |= {f"latency_{n}": self.latency.quantile(q) for n, q in quantiles.items()}
            numbers["latency_longest"] = self.latency.longest
        return numbers | dict(self.faults or {})
