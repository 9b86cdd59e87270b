"""The typed face of the compiled module; see engine/python/bindings.cpp."""

from collections.abc import Callable, Sequence
from enum import Enum
from typing import Any, Generic, Self, TypeVar

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
    @property
    def n_axes(self) -> int: ...

class MotionLikelihood:
    def __init__(
        self,
        *,
        n_axes: int,
        points: NDArray[np.float64],
        frames: NDArray[np.int64],
        offsets: NDArray[np.int64],
        kind: NDArray[np.int32],
        steps: NDArray[np.float64],
    ) -> None: ...
    def sum(
        self,
        *,
        squares: NDArray[np.float64],
        transitions: NDArray[np.float64],
        variance: float,
        velocity_variance: float,
    ) -> float: ...

class ScoreModel:
    def __init__(
        self,
        *,
        birth_density: float,
        clutter_density: float,
        p_detection: float,
        p_redetection: float,
        p_disappear: float,
        max_speed: float,
        speed_margin: float,
        max_gap: int,
        last_termination: bool,
    ) -> None: ...

class CandidateLimit(Exception): ...
class FrontierLimit(Exception): ...

class Pairing(Enum):
    assignment = ...
    tracks_propose = ...
    detections_propose = ...

class SplitBy(Enum):
    whole = ...
    likelihood = ...
    cells = ...
    clusters = ...

class LensKind(Enum):
    none = ...
    radial = ...
    quadratic = ...

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
    @property
    def n_bonds(self) -> int: ...
    @property
    def n_carried(self) -> int: ...
    @property
    def n_returned(self) -> int: ...
    @property
    def n_refused(self) -> int: ...

class JointStats(FrameStats):
    @property
    def n_beams(self) -> int: ...
    @property
    def n_states(self) -> int: ...
    @property
    def n_unguarded(self) -> int: ...
    @property
    def bound(self) -> float: ...

class TreeStats(FrameStats):
    @property
    def n_branches(self) -> int: ...
    @property
    def most_branches(self) -> int: ...
    @property
    def n_cut(self) -> int: ...
    @property
    def n_limited(self) -> int: ...
    @property
    def n_shared(self) -> int: ...
    @property
    def n_beams(self) -> int: ...
    @property
    def n_hypotheses(self) -> int: ...
    @property
    def n_merged(self) -> int: ...
    @property
    def n_nodes(self) -> int: ...
    @property
    def bound(self) -> float: ...
    @property
    def gap(self) -> float: ...

class ChainStats:
    @property
    def moves(self) -> NDArray[np.int64]: ...
    @property
    def n_search(self) -> int: ...
    @property
    def n_sampled(self) -> int: ...
    @property
    def n_walked(self) -> int: ...
    @property
    def n_sure(self) -> int: ...
    @property
    def n_cut(self) -> int: ...
    @property
    def n_given(self) -> int: ...
    @property
    def n_refused(self) -> int: ...
    @property
    def n_doubtful(self) -> int: ...
    @property
    def n_unmoved(self) -> int: ...
    @property
    def rhat(self) -> float: ...
    @property
    def ess(self) -> float: ...

class SampledStats(FrameStats):
    @property
    def chain(self) -> ChainStats: ...

class McmcOptions:
    def __init__(
        self,
        *,
        window: int,
        is_whole: bool,
        block: int,
        moves: float,
        deadline: float,
        has_assignment: bool,
        confidence: float,
        chains: int,
        threads: int,
        split_by: SplitBy,
        doubt: float,
        distance: float,
        bonds: int,
        tolerance: float,
    ) -> None: ...

class LifeOptions:
    def __init__(
        self, *, gate: float, confirm_score: float, delete_drop: float, max_candidates: int
    ) -> None: ...

_T = TypeVar("_T")

class StepResult(Generic[_T]):
    @property
    def tracker(self) -> _T: ...
    @property
    def labels(self) -> NDArray[np.int64]: ...
    @property
    def confidence(self) -> NDArray[np.float64]: ...
    @property
    def revised(self) -> NDArray[np.int64]: ...
    @property
    def revised_labels(self) -> NDArray[np.int64]: ...
    @property
    def revised_confidence(self) -> NDArray[np.float64]: ...
    @property
    def stats(self) -> FrameStats: ...

# What all trackers have; there is no such class in the module.
class _Tracker:
    def step(
        self,
        time: float,
        F: NDArray[np.float64],
        Q: NDArray[np.float64],
        points: NDArray[np.float64],
    ) -> StepResult[Self]: ...
    def run(
        self,
        times: NDArray[np.float64],
        kind: NDArray[np.int32],
        F: NDArray[np.float64],
        Q: NDArray[np.float64],
        offsets: NDArray[np.int64],
        points: NDArray[np.float64],
        labels: NDArray[np.int64],
        confidence: NDArray[np.float64],
    ) -> None: ...
    def copy(self) -> Self: ...
    def tracks(self) -> dict[str, NDArray[Any]]: ...
    @property
    def has_confidence(self) -> bool: ...
    @property
    def n_frames(self) -> int: ...
    @property
    def n_seen(self) -> int: ...
    @property
    def n_ids(self) -> int: ...
    @property
    def last_time(self) -> float: ...
    @property
    def total(self) -> FrameStats: ...

class CarryOptions:
    def __init__(
        self, *, is_on: bool = False, max_carried: int = 0, bond_weight: float = 0.0
    ) -> None: ...

class BodyCarrier:
    def __init__(self, *, n_axes: int, noise_sigma: float) -> None: ...
    def see(self, markers: NDArray[np.int64], points: NDArray[np.float64]) -> None: ...
    def carry(
        self, marker: int, markers: NDArray[np.int64], points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], float, int] | None: ...
    def n_bonds(self, marker: int) -> int: ...
    def forget(self, marker: int) -> None: ...

class FrameTracker(_Tracker):
    def __init__(
        self,
        model: MotionModel,
        score: ScoreModel,
        life: LifeOptions,
        *,
        pairing: Pairing,
        is_strict: bool,
        capacity: int,
        merged_within: float,
        carry: CarryOptions,
    ) -> None: ...

class JointTracker(_Tracker):
    def __init__(
        self,
        model: MotionModel,
        score: ScoreModel,
        life: LifeOptions,
        *,
        max_states: int,
        is_guarded: bool,
        is_sure_until_gap: bool,
        carry: CarryOptions,
    ) -> None: ...

class BranchOptions:
    def __init__(
        self,
        *,
        window: int,
        max_branches: int,
        merge_last: int,
        prune_drop: float,
        fading: float,
        delta: NDArray[np.float64],
        z: float,
    ) -> None: ...

class TreeTracker(_Tracker):
    def __init__(
        self,
        model: MotionModel,
        score: ScoreModel,
        life: LifeOptions,
        branches: BranchOptions,
        *,
        pairing: Pairing,
        is_independent: bool,
        carry: CarryOptions,
    ) -> None: ...
    def chi2(self) -> dict[str, NDArray[Any]]: ...

_Choose = Callable[
    [
        NDArray[np.int64],
        NDArray[np.float64],
        NDArray[np.int64],
        NDArray[np.int32],
        NDArray[np.int32],
    ],
    tuple[NDArray[np.int32], float],
]

class HypothesisTracker(_Tracker):
    def __init__(
        self,
        model: MotionModel,
        score: ScoreModel,
        life: LifeOptions,
        branches: BranchOptions,
        *,
        max_hypotheses: int,
        max_nodes: int,
        new_track_claim: float,
        carry: CarryOptions,
        choose: _Choose | None = None,
    ) -> None: ...

class MatrixTracker(_Tracker):
    def __init__(
        self,
        model: MotionModel,
        score: ScoreModel,
        life: LifeOptions,
        branches: BranchOptions,
        *,
        max_hypotheses: int,
        merged_within: float,
        new_track_claim: float,
        carry: CarryOptions,
    ) -> None: ...
    def clusters(
        self,
    ) -> list[
        tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]
    ]: ...

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
def k_best(cost: NDArray[np.float64], k: int) -> NDArray[np.int32]: ...
def pack(
    first_option: NDArray[np.int64],
    worths: NDArray[np.float64],
    first_use: NDArray[np.int64],
    uses: NDArray[np.int32],
    k: int,
    drop: float,
    max_nodes: int,
) -> tuple[NDArray[np.int32], NDArray[np.float64], bool, float, int]: ...
def packing_losses(
    first_option: NDArray[np.int64],
    worths: NDArray[np.float64],
    first_use: NDArray[np.int64],
    uses: NDArray[np.int32],
) -> tuple[float, NDArray[np.float64]]: ...
def joint_marginals(
    log_weights: NDArray[np.float64], log_miss: NDArray[np.float64], max_states: int
) -> tuple[NDArray[np.float64], float, NDArray[np.int32], float, int]: ...
def marry(
    first: NDArray[np.int64],
    receivers: NDArray[np.int32],
    costs: NDArray[np.float64],
    n_receivers: int,
) -> tuple[NDArray[np.int32], int]: ...

class Camera:
    def __init__(
        self,
        *,
        R: NDArray[np.float64],
        t: NDArray[np.float64],
        A: NDArray[np.float64],
        B: NDArray[np.float64],
        lens_kind: LensKind,
        is_backward: bool,
        coefficients: NDArray[np.float64],
        r_end: float,
        q_table: float,
        start: tuple[float, float],
        near: float,
        far: float,
        width: int,
        height: int,
    ) -> None: ...
    def undistort(self, pixels: NDArray[np.float64]) -> NDArray[np.float64]: ...
    def distort(self, normalised: NDArray[np.float64]) -> NDArray[np.float64]: ...
    def jacobian(self, points: NDArray[np.float64]) -> NDArray[np.float64]: ...

class Surfaces:
    def __init__(
        self,
        *,
        vertices: NDArray[np.float64],
        faces: NDArray[np.int32],
        face_owners: NDArray[np.int32],
        ends: NDArray[np.float64],
        radii: NDArray[np.float64],
        capsule_owners: NDArray[np.int32],
    ) -> None: ...

class RayGrid:
    def __init__(self, camera: Camera) -> None: ...
    def depth_image(
        self, camera: Camera, surfaces: Sequence[Surfaces], moment: int
    ) -> tuple[NDArray[np.float64], NDArray[np.int32]]: ...
    def paint(
        self, corners: NDArray[np.float64], owners: NDArray[np.int32]
    ) -> tuple[NDArray[np.float64], NDArray[np.int32]]: ...

def project(
    cameras: Sequence[Camera],
    points: NDArray[np.float64],
    surfaces: Sequence[Surfaces],
    clearance: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.uint8], NDArray[np.int32]]: ...

class ViewSolver:
    def __init__(
        self,
        *,
        cameras: Sequence[Camera],
        sigma: NDArray[np.float64],
        p_detection: NDArray[np.float64],
        clutter: NDArray[np.float64],
        log_density: float,
        gate: float,
        min_views: int,
        low: tuple[float, float, float],
        high: tuple[float, float, float],
    ) -> None: ...
    def reconstruct(
        self,
        pixels: NDArray[np.float64],
        offsets: NDArray[np.int64],
        priors: NDArray[np.float64],
        prior_offsets: NDArray[np.int64],
        merge: float,
        max_nodes: int,
        n_threads: int,
    ) -> tuple[
        NDArray[np.float64],
        NDArray[np.float64],
        NDArray[np.int64],
        NDArray[np.int64],
        NDArray[np.int64],
        NDArray[np.int64],
        float,
    ]: ...
    def candidates(
        self, pixels: NDArray[np.float64], offsets: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]: ...

def choose_candidates(
    scores: NDArray[np.float64],
    first: NDArray[np.int64],
    views: NDArray[np.int64],
    max_nodes: int,
) -> tuple[NDArray[np.int64], bool, float]: ...

class ChainOptions:
    def __init__(
        self,
        *,
        weights: NDArray[np.float64],
        is_informed: bool,
        stop: float,
        floor: float,
        has_first_rules: bool,
        is_ascent: bool,
        share_at_doubts: float = 0.0,
        is_draw: bool = False,
    ) -> None: ...

# One for models with one motion, one for those with several.
class _ChainTracker(_Tracker):
    def __init__(
        self,
        model: MotionModel,
        score: ScoreModel,
        chain: ChainOptions,
        options: McmcOptions,
        seed: int,
    ) -> None: ...
    def start_from(self, labels: NDArray[np.int64]) -> None: ...
    def finish(
        self,
        labels: NDArray[np.int64],
        confidence: NDArray[np.float64],
        goes_on: Callable[[float], bool],
    ) -> None: ...

class OneMotionTracker(_ChainTracker): ...
class SeveralMotionsTracker(_ChainTracker): ...

class Chain:
    def __init__(
        self, model: MotionModel, score: ScoreModel, options: ChainOptions, seed: int
    ) -> None: ...
    def add_frame(
        self,
        time: float,
        F: NDArray[np.float64],
        Q: NDArray[np.float64],
        points: NDArray[np.float64],
    ) -> None: ...
    def freeze(self, frame: int) -> None: ...
    def assign(self, labels: NDArray[np.int64]) -> None: ...
    def labels(self) -> NDArray[np.int64]: ...
    def log_posterior(self) -> float: ...
    def run(self, n_moves: int) -> None: ...
    def counts(self) -> NDArray[np.int64]: ...
    def visits(self, n_moves: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]: ...
    def trace(
        self, n_moves: int
    ) -> list[
        tuple[int, int, NDArray[np.int64], NDArray[np.int64], float, float, float, bool, float]
    ]: ...

BEND: float
MIN_TOGETHER: int

# (predictive variances, whether each is a bond)
def judge_distances(
    means: NDArray[np.float64], variances: NDArray[np.float64], frames: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]: ...

# (R, from, to, rms): b = R (a - from) + to, in three axes.
def fit_rigid(
    a: NDArray[np.float64], b: NDArray[np.float64], weights: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float]: ...

# (where they carry what was at `then`, its variance beside `r`, log densities at some points)
def carried(
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    weights: NDArray[np.float64],
    then: NDArray[np.float64],
    r: float,
    points: NDArray[np.float64],
) -> tuple[NDArray[np.float64], float, NDArray[np.float64]]: ...

# Log density of each of some points of a frame among the others, where some were seen before.
def densities_elsewhere(
    before: NDArray[np.float64],
    points: NDArray[np.float64],
    *,
    noise: float,
    ghost_radius: float,
) -> NDArray[np.float64]: ...

class Neighbours:
    def __init__(self, n_axes: int, r: float) -> None: ...
    def add(self, markers: NDArray[np.int32], points: NDArray[np.float64]) -> None: ...
    # (the others, frames seen together, mean distances, their variances, predictive variances)
    def of(
        self, marker: int
    ) -> tuple[
        NDArray[np.int64],
        NDArray[np.int64],
        NDArray[np.float64],
        NDArray[np.float64],
        NDArray[np.float64],
    ]: ...

class StitchOptions:
    def __init__(
        self,
        *,
        noise: float,
        ghost_radius: float,
        confirm: int,
        max_gap: int,
        max_hidden: int,
        may_cut: bool,
    ) -> None: ...

class Stitcher:
    WORTH: float
    def __init__(self, motion: MotionModel, options: StitchOptions) -> None: ...
    def advise(
        self,
        labels: NDArray[np.int64],
        before: NDArray[np.int64],
        weights: NDArray[np.float64],
    ) -> None: ...
    # (fragment of each point, and of each fragment its marker, the fragment before, how probably)
    def run(
        self,
        motion: MotionModel,
        times: NDArray[np.float64],
        kind: NDArray[np.int32],
        F: NDArray[np.float64],
        Q: NDArray[np.float64],
        offsets: NDArray[np.int64],
        points: NDArray[np.float64],
        labels: NDArray[np.int64],
    ) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32], NDArray[np.float64]]: ...
    @property
    def n_cuts(self) -> int: ...
    @property
    def n_markers(self) -> int: ...

class LiveStitcher:
    def __init__(self, motion: MotionModel, options: StitchOptions, *, lag: int) -> None: ...
    # (new state, markers, earlier detections whose marker changes, their markers)
    def step(
        self,
        F: NDArray[np.float64],
        Q: NDArray[np.float64],
        points: NDArray[np.float64],
        labels: NDArray[np.int64],
        revised: NDArray[np.int64],
        revised_labels: NDArray[np.int64],
    ) -> tuple[LiveStitcher, NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]: ...
    @property
    def n_seen(self) -> int: ...
    @property
    def n_joins(self) -> int: ...
    @property
    def n_ghosts(self) -> int: ...
    @property
    def n_cuts(self) -> int: ...
    @property
    def n_markers(self) -> int: ...
    @property
    def n_remembered(self) -> int: ...
