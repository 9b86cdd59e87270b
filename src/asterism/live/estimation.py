"""Estimation of the model while a stream runs, in a process of its own.

The process reads detections from standard input and writes a model to standard output
(`estimate_input`). A thread would delay the frames, because it shares the interpreter.
"""

from __future__ import annotations

import io
import math
import os
import subprocess
import sys
import threading
import tomllib
from typing import TYPE_CHECKING, Protocol

import numpy as np

from asterism.errors import AsterismError
from asterism.model import Detections, TrackingModel
from asterism.tracking import estimate_model

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["BackgroundEstimator", "DirectEstimator", "Estimator", "differs", "estimate_input"]

_PROGRAM = "from asterism.live.estimation import estimate_input; estimate_input()"
_NICENESS = 10
_RATIO = 1.25
"""Ratio of two values from which on a refined model replaces the present one."""


class Estimator(Protocol):
    """Estimates one model at a time."""

    @property
    def is_busy(self) -> bool:
        """Whether an estimate has begun whose result was not taken up."""
        ...

    def prepare(self) -> None:
        """Get ready for an estimate that comes soon."""
        ...

    def start(self, detections: Detections) -> None:
        """Begin an estimate."""
        ...

    def result(self) -> TrackingModel | str | None:
        """Return the model, the reason why there is none, or None while it is being estimated."""
        ...

    def close(self) -> None:
        """End an estimate that is not finished."""
        ...


class DirectEstimator:
    """Estimates at once, for sources that can wait."""

    def __init__(self) -> None:
        self._result: TrackingModel | str | None = None

    @property
    def is_busy(self) -> bool:
        """Whether there is a result that was not taken up."""
        return self._result is not None

    def prepare(self) -> None:
        """Do nothing."""

    def start(self, detections: Detections) -> None:
        """Estimate a model."""
        self._result = _estimated(detections)

    def result(self) -> TrackingModel | str | None:
        """Return the model, or the reason why there is none; None before the first start."""
        result, self._result = self._result, None
        return result

    def close(self) -> None:
        """Do nothing."""


class BackgroundEstimator:
    """Estimates in another process of low priority."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._thread: threading.Thread | None = None
        self._output = b""

    @property
    def is_busy(self) -> bool:
        """Whether the process runs, or its result was not taken up."""
        return self._thread is not None

    def prepare(self) -> None:
        """Start the process, which imports what it needs and waits."""
        self._process = subprocess.Popen(
            [sys.executable, "-c", _PROGRAM],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is for this process alone
        )  # fmt: skip

    def start(self, detections: Detections) -> None:
        """Send the detections to the process."""
        if self._process is None:
            self.prepare()
        process = self._process
        assert process is not None
        arrays = {"times": detections.times, "offsets": detections.offsets,
                  "points": detections.points}  # fmt: skip
        if detections.covariances is not None:
            arrays["covariances"] = detections.covariances

        def talk() -> None:
            packed = io.BytesIO()
            np.savez(packed, allow_pickle=False, **arrays)
            self._output = process.communicate(packed.getvalue())[0]

        self._thread = threading.Thread(target=talk, name="model", daemon=True)
        self._thread.start()

    def result(self) -> TrackingModel | str | None:
        """Return what the process has written, None while it runs."""
        if self._thread is None or self._thread.is_alive():
            return None
        self._thread = self._process = None
        text = self._output.decode()
        if text.startswith("model\n"):
            return TrackingModel.from_dict(tomllib.loads(text.removeprefix("model\n")))
        return text.removeprefix("error\n") or "the process of the estimate has failed"

    def close(self) -> None:
        """Kill a process that still runs."""
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        if self._thread is not None:
            self._thread.join(5.0)
            self._thread = None
        else:
            process.communicate()


def differs(new: TrackingModel, old: TrackingModel) -> bool:
    """Return whether a refined model differs so much that it replaces the present one.

    Parameters
    ----------
    new, old : TrackingModel
        Refined and present model.

    Returns
    -------
    bool
        Whether noise, missed detections, motion or the largest speed differ by over 25 %, or the
        number of motions is another.

    Examples
    --------
    >>> import asterism as am
    >>> model = am.estimate_model(am.simulate.cube(frames=40, seed=1).detections).model
    >>> differs(model, model)
    False
    """
    if len(new.motion.modes) != len(old.motion.modes):
        return True
    pairs = [
        (new.sensor.noise_sigma, old.sensor.noise_sigma),
        (1.01 - new.sensor.p_detection, 1.01 - old.sensor.p_detection),
        (new.population.max_speed, old.population.max_speed),
        *zip(_spreads(new), _spreads(old), strict=True),
    ]
    return any(not 1 / _RATIO <= a / b <= _RATIO for a, b in pairs if a != b)


def _spreads(model: TrackingModel) -> list[float]:
    """Return the standard deviation of a position after a tenth of a second, of each motion."""
    dt: NDArray[np.float64] = np.array([0.1])
    return [math.sqrt(float(mode.process_noise(dt)[0, 0, 0])) for mode in model.motion.modes]


def _estimated(detections: Detections) -> TrackingModel | str:
    try:
        return estimate_model(detections).model
    except AsterismError as error:
        return str(error)


def estimate_input() -> None:
    """Estimate the model of the detections on standard input, and write it to standard output."""
    if hasattr(os, "nice"):
        os.nice(_NICENESS)
    with np.load(io.BytesIO(sys.stdin.buffer.read()), allow_pickle=False) as arrays:
        result = _estimated(Detections(**arrays))
    text = f"error\n{result}" if isinstance(result, str) else f"model\n{result.to_toml()}"
    sys.stdout.buffer.write(text.encode())
