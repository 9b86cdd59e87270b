"""The typed face of the compiled module; see engine/bindings.cpp."""

import numpy as np
from numpy.typing import NDArray

class MotionModel:
    @staticmethod
    def make(
        n_axes: int,
        H: NDArray[np.float64],
        P0: NDArray[np.float64],
        noise_sigma: float,
        T: NDArray[np.float64],
    ) -> MotionModel: ...

class ScoreModel:
    def __init__(
        self,
        *,
        birth_density: float,
        clutter_density: float,
        p_detection: float,
        p_disappear: float,
        max_speed: float,
        speed_margin: float,
        max_gap: int,
        last_termination: bool,
    ) -> None: ...

class FrameStats:
    @property
    def n_candidates(self) -> int: ...
    @property
    def n_groups(self) -> int: ...
    @property
    def largest_group(self) -> int: ...
    @property
    def n_confirmed(self) -> int: ...
    @property
    def n_tentative(self) -> int: ...
    @property
    def n_pending(self) -> int: ...

class FrameTracker:
    def __init__(
        self,
        model: MotionModel,
        score: ScoreModel,
        *,
        matcher: int,
        gate: float,
        confirm_score: float,
        delete_drop: float,
        max_candidates: int,
    ) -> None: ...
    def step(
        self,
        time: float,
        F: NDArray[np.float64],
        Q: NDArray[np.float64],
        points: NDArray[np.float64],
    ) -> tuple[
        FrameTracker, NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], FrameStats
    ]: ...
    def run(
        self,
        times: NDArray[np.float64],
        kind: NDArray[np.int32],
        F: NDArray[np.float64],
        Q: NDArray[np.float64],
        offsets: NDArray[np.int64],
        points: NDArray[np.float64],
        labels: NDArray[np.int64],
    ) -> FrameStats: ...
    def copy(self) -> FrameTracker: ...
    def tracks(
        self,
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]: ...
    @property
    def n_frames(self) -> int: ...
    @property
    def n_seen(self) -> int: ...
    @property
    def n_ids(self) -> int: ...
    @property
    def last_time(self) -> float: ...

def score_tracks(
    model: MotionModel,
    score: ScoreModel,
    points: NDArray[np.float64],
    frames: NDArray[np.int64],
    offsets: NDArray[np.int64],
    times: NDArray[np.float64],
    kind: NDArray[np.int32],
    F: NDArray[np.float64],
    Q: NDArray[np.float64],
) -> NDArray[np.float64]: ...
def filter_tracks(
    model: MotionModel,
    points: NDArray[np.float64],
    frames: NDArray[np.int64],
    offsets: NDArray[np.int64],
    times: NDArray[np.float64],
    kind: NDArray[np.int32],
    F: NDArray[np.float64],
    Q: NDArray[np.float64],
    smooth: bool,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]: ...
def assign(
    n_rows: int,
    n_columns: int,
    rows: NDArray[np.int32],
    columns: NDArray[np.int32],
    gains: NDArray[np.float64],
) -> NDArray[np.int32]: ...
def marry(
    first: NDArray[np.int64],
    receivers: NDArray[np.int32],
    costs: NDArray[np.float64],
    n_receivers: int,
) -> tuple[NDArray[np.int32], int]: ...
