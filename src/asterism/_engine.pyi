"""The typed face of the compiled module; see engine/python/bindings.cpp."""

from collections.abc import Callable, Sequence
from enum import Enum
from typing import Any, Final, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
Shorts: TypeAlias = NDArray[np.int32]

class MotionModel:
    @staticmethod
    def make(n_axes: int, H: Floats, P0: Floats, noise_sigma: float, T: Floats) -> MotionModel: ...
    n_axes: Final[int]

class MotionLikelihood:
    def __init__(
        self,
        *,
        n_axes: int,
        points: Floats,
        frames: Ints,
        offsets: Ints,
        kind: Shorts,
        steps: Floats,
    ) -> None: ...
    def sums(
        self, *, squares: Floats, transitions: Floats, variances: Floats, velocity_variance: float
    ) -> Floats: ...

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

class ExchangeEvidence(Enum):
    medians = ...
    spreads = ...
    motion = ...

class LensKind(Enum):
    none = ...
    radial = ...
    quadratic = ...

class FrameStats:
    n_candidates: Final[int]
    n_groups: Final[int]
    largest_group: Final[int]
    n_confirmed: Final[int]
    n_tentative: Final[int]
    n_pending: Final[int]
    n_carried: Final[int]
    n_returned: Final[int]
    n_refused: Final[int]

class JointStats(FrameStats):
    n_beams: Final[int]
    n_states: Final[int]
    n_unguarded: Final[int]
    bound: Final[float]

class TreeStats(FrameStats):
    n_branches: Final[int]
    peak_branches: Final[int]
    n_cut: Final[int]
    n_limited: Final[int]
    n_shared: Final[int]
    n_beams: Final[int]
    n_hypotheses: Final[int]
    n_merged: Final[int]
    n_nodes: Final[int]
    bound: Final[float]
    gap: Final[float]

class ChainStats:
    moves: Final[Ints]
    n_search: Final[int]
    n_sampled: Final[int]
    n_walked: Final[int]
    n_sure: Final[int]
    n_cut: Final[int]
    n_given: Final[int]
    n_refused: Final[int]
    n_disagreements: Final[int]
    n_unmoved: Final[int]
    rhat: Final[float]
    ess: Final[float]

class SampledStats(FrameStats):
    chain: Final[ChainStats]

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
        ambiguous_within: float,
        distance: float,
        bonds: int,
        tolerance: float,
    ) -> None: ...

class LifeOptions:
    def __init__(
        self, *, gate: float, confirm_score: float, delete_drop: float, max_candidates: int
    ) -> None: ...

# What all trackers have; there is no such class in the module.
class _Tracker:
    # (labels, confidence, earlier detections whose label changes, their labels, their confidence,
    # counts); a confidence is None if the tracker provides none. With a stitcher, which is changed
    # too, labels are markers; `before` is the stitcher that it is a copy of.
    def step(
        self,
        time: float,
        F: Floats,
        Q: Floats,
        points: Floats,
        stitcher: LiveStitcher | None = None,
        before: LiveStitcher | None = None,
    ) -> tuple[Ints, Floats | None, Ints, Ints, Floats | None, FrameStats]: ...
    def run(
        self,
        times: Floats,
        kind: Shorts,
        F: Floats,
        Q: Floats,
        offsets: Ints,
        points: Floats,
        labels: Ints,
        confidence: Floats,
    ) -> None: ...
    def copy(self) -> Self: ...
    # (ids, frames since the last detection, log odds, means, covariances) of the confirmed tracks,
    # or of the markers of a stitcher
    def tracks(
        self, stitcher: LiveStitcher | None = None
    ) -> tuple[Ints, Ints, Floats, Floats, Floats]: ...
    has_confidence: Final[bool]
    n_frames: Final[int]
    n_seen: Final[int]
    n_ids: Final[int]
    last_time: Final[float]
    total: Final[FrameStats]

class CarryOptions:
    def __init__(self, *, is_on: bool = False, max_carried: int = 0) -> None: ...

def decide_jointly(
    *,
    centers: Floats,
    track_variances: Floats,
    ends: Ints,
    n: Ints,
    means: Floats,
    variances: Floats,
    points: Floats,
    rows: Ints,
    columns: Ints,
    gains: Floats,
) -> Ints: ...

class RigidCarrier:
    def __init__(self, *, n_axes: int, noise_sigma: float) -> None: ...
    def see(self, markers: Ints, points: Floats) -> None: ...
    def carry(
        self, marker: int, markers: Ints, points: Floats
    ) -> tuple[Floats, float, int] | None: ...
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
        delta: Floats,
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

_Choose = Callable[[Ints, Floats, Ints, Shorts, Shorts], tuple[Shorts, float]]

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
    def clusters(self) -> list[tuple[Ints, Ints, Ints, Floats]]: ...

def score_tracks(
    model: MotionModel,
    score: ScoreModel,
    points: Floats,
    frames: Ints,
    offsets: Ints,
    times: Floats,
    kind: Shorts,
    F: Floats,
    Q: Floats,
) -> Floats: ...
def filter_tracks(
    model: MotionModel,
    points: Floats,
    frames: Ints,
    offsets: Ints,
    times: Floats,
    kind: Shorts,
    F: Floats,
    Q: Floats,
    smooth: bool,
) -> tuple[Floats, Floats, Ints, Floats]: ...
def assign(n_rows: int, n_columns: int, rows: Shorts, columns: Shorts, gains: Floats) -> Shorts: ...

class NearestPoints:
    def __init__(self, points: Floats, offsets: Ints) -> None: ...
    def two(self, places: Floats, frames: Ints) -> tuple[Ints, Floats]: ...

def k_best(cost: Floats, k: int) -> Shorts: ...
def pack(
    first_option: Ints,
    log_weights: Floats,
    first_use: Ints,
    uses: Shorts,
    k: int,
    drop: float,
    max_nodes: int,
) -> tuple[Shorts, Floats, bool, float, int]: ...
def packing_losses(
    first_option: Ints, log_weights: Floats, first_use: Ints, uses: Shorts
) -> tuple[float, Floats]: ...
def joint_marginals(
    log_weights: Floats,
    log_miss: Floats,
    max_states: int,
    negligible: float = 0.0,
) -> tuple[Floats, float, Shorts, float, int]: ...
def marginal_bounds(log_weights: Floats, log_miss: Floats) -> Floats: ...
def marry(
    first: Ints, receivers: Shorts, costs: Floats, n_receivers: int
) -> tuple[Shorts, int]: ...

class Camera:
    def __init__(
        self,
        *,
        R: Floats,
        t: Floats,
        A: Floats,
        B: Floats,
        lens_kind: LensKind,
        is_backward: bool,
        coefficients: Floats,
        r_end: float,
        q_table: float,
        start: tuple[float, float],
        near: float,
        far: float,
        width: int,
        height: int,
    ) -> None: ...
    def undistort(self, pixels: Floats) -> Floats: ...
    def distort(self, normalised: Floats) -> Floats: ...
    def jacobian(self, points: Floats) -> Floats: ...

class Surfaces:
    def __init__(
        self,
        *,
        vertices: Floats,
        faces: Shorts,
        face_owners: Shorts,
        ends: Floats,
        radii: Floats,
        capsule_owners: Shorts,
    ) -> None: ...

class RayGrid:
    def __init__(self, camera: Camera) -> None: ...
    def depth_image(
        self, camera: Camera, surfaces: Sequence[Surfaces], moment: int
    ) -> tuple[Floats, Shorts]: ...
    def paint(self, corners: Floats, owners: Shorts) -> tuple[Floats, Shorts]: ...

def project(
    cameras: Sequence[Camera], points: Floats, surfaces: Sequence[Surfaces], clearance: float
) -> tuple[Floats, Floats, NDArray[np.uint8], Shorts]: ...

class ViewSolver:
    def __init__(
        self,
        *,
        cameras: Sequence[Camera],
        sigma: Floats,
        p_detection: Floats,
        clutter: Floats,
        log_density: float,
        gate: float,
        min_views: int,
        low: tuple[float, float, float],
        high: tuple[float, float, float],
    ) -> None: ...
    def reconstruct(
        self,
        pixels: Floats,
        offsets: Ints,
        priors: Floats,
        prior_offsets: Ints,
        merge: float,
        max_nodes: int,
        n_threads: int,
    ) -> tuple[Floats, Floats, Ints, Ints, Ints, Ints, float]: ...

class ChainOptions:
    def __init__(
        self,
        *,
        weights: Floats,
        is_informed: bool,
        stop: float,
        floor: float,
        has_first_rules: bool,
        is_ascent: bool,
        share_at_ambiguous: float = 0.0,
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
    def start_from(self, labels: Ints, shared: SharedAcceleration | None = None) -> None: ...
    def finish(
        self, labels: Ints, confidence: Floats, goes_on: Callable[[float], bool]
    ) -> None: ...

class OneMotionTracker(_ChainTracker): ...
class SeveralMotionsTracker(_ChainTracker): ...

class Chain:
    def __init__(
        self, model: MotionModel, score: ScoreModel, options: ChainOptions, seed: int
    ) -> None: ...
    def add_frame(self, time: float, F: Floats, Q: Floats, points: Floats) -> None: ...
    def freeze(self, frame: int) -> None: ...
    def assign(self, labels: Ints) -> None: ...
    def give(self, labels: Ints, shared: SharedAcceleration) -> None: ...
    def labels(self) -> Ints: ...
    def log_posterior(self) -> float: ...
    def run(self, n_moves: int) -> None: ...
    def visits(self, n_moves: int) -> tuple[Ints, Ints]: ...
    def trace(
        self, n_moves: int
    ) -> list[tuple[int, int, Ints, Ints, float, float, float, bool, float]]: ...

BEND: float
MIN_TOGETHER: int

# (predictive variances, whether each is a bond)
def judge_distances(
    means: Floats, variances: Floats, frames: Ints
) -> tuple[Floats, NDArray[np.bool_]]: ...

# (R, from, to, rms): b = R (a - from) + to, in three axes.
def fit_rigid(a: Floats, b: Floats, weights: Floats) -> tuple[Floats, Floats, Floats, float]: ...

# Bonds of marker k: offsets[k] to offsets[k + 1]. Shapes (B, D) and (K, D); log weights (K, 10).
class SharedAcceleration:
    def __init__(
        self,
        *,
        offsets: Ints,
        others: Shorts,
        distances: Floats,
        variances: Floats,
        shape: Floats,
        own_shape: Floats,
        log_weights: Floats,
        log_begin_weights: Floats,
        volume: float,
    ) -> None: ...

# (log densities (N, C) of the detections of tracks, of which each is of a marker or -1; predicted
# positions and variances (N, D + 1))
def shared_densities(
    shared: SharedAcceleration,
    model: MotionModel,
    markers: Shorts,
    is_counted: NDArray[np.bool_],
    points: Floats,
    frames: Ints,
    offsets: Ints,
    times: Floats,
    kind: Shorts,
    F: Floats,
    Q: Floats,
) -> tuple[Floats, Floats]: ...

# Rotations (F, D, D) of a shape (n, D) that fit its points (F n, D).
def turns(shape: Floats, points: Floats, weights: Floats) -> Floats: ...

# (last points before (n, 2), first points after (n, 2), log-likelihood ratios, frames)
def exchanges(
    motion: MotionModel,
    times: Floats,
    kind: Shorts,
    F: Floats,
    Q: Floats,
    points: Floats,
    frames: Ints,
    offsets: Ints,
    *,
    p_detection: float,
    n_threads: int,
) -> tuple[Ints, Ints, Floats, Ints]: ...

# Log-likelihood ratios of the exchanges of two tracks at the frames `cuts`.
def exchange_ratios(
    motion: MotionModel,
    times: Floats,
    kind: Shorts,
    F: Floats,
    Q: Floats,
    points: Floats,
    frames: Ints,
    offsets: Ints,
    cuts: Ints,
    *,
    p_detection: float,
) -> Floats: ...

# (tracks (n, 2), first frame and end (n, 2), log odds) of stretches in which tracks have each
# other's marker, for pairs with a track that is examined.
def exchanged_stretches(
    motion: MotionModel,
    times: Floats,
    kind: Shorts,
    F: Floats,
    Q: Floats,
    points: Floats,
    frames: Ints,
    offsets: Ints,
    is_examined: NDArray[np.bool_],
    *,
    p_detection: float,
    noise: float,
    evidence: ExchangeEvidence,
) -> tuple[Ints, Ints, Floats]: ...

# Track of each detection, with those of tracks that had none in the frame.
def find_lost(
    points: Floats,
    labels: Ints,
    offsets: Ints,
    distances: Floats,
    spreads: Floats,
) -> Ints: ...

# `samples` are the frames from which the distances that each track keeps are learnt.
class DistanceProfiles:
    def __init__(
        self,
        points: Floats,
        labels: Ints,
        offsets: Ints,
        samples: Ints,
        *,
        n_tracks: int,
        noise: float,
    ) -> None: ...
    # Log density ratio of one marker against two, of pairs of tracks.
    def agreements(self, pairs: Ints) -> Floats: ...
    # Track of each detection, the open ones assigned again and pairs of tracks exchanged.
    def assigned(
        self,
        points: Floats,
        labels: Ints,
        offsets: Ints,
        is_open: NDArray[np.bool_],
        ghost: Floats,
        sigma: Floats,
        *,
        log_clutter: float,
        change: float,
        max_gap: int,
    ) -> Ints: ...
    # (whether distances are known, log densities of an unknown marker, the same by ranges, other
    # tracks, theirs)
    def compare(
        self, tracks: Ints, frames: Ints, offsets: Ints, partners: Ints, *, n_threads: int
    ) -> tuple[NDArray[np.bool_], Floats, Floats, Ints, Floats]: ...
    # Log densities of other tracks and of an unknown marker, relative to the own track.
    def densities(self, tracks: Ints, frames: Ints, offsets: Ints, others: Ints) -> Floats: ...
    # Log odds of each asked detection being of its track instead of clutter, 0 without a track.
    def supports(
        self,
        points: Floats,
        labels: Ints,
        offsets: Ints,
        is_asked: NDArray[np.bool_],
        ghost: Floats,
        sigma: Floats,
        *,
        log_clutter: float,
        max_gap: int,
    ) -> Floats: ...

# (predicted position of what was at `then`, its variance beyond `r`, log densities of points)
def carried(
    a: Floats, b: Floats, weights: Floats, then: Floats, r: float, points: Floats
) -> tuple[Floats, float, Floats]: ...

# Background log density of each point of a frame, given earlier points.
def background_densities(
    before: Floats, points: Floats, *, noise: float, ghost_radius: float
) -> Floats: ...

class Neighbours:
    def __init__(self, n_axes: int, r: float) -> None: ...
    def add(self, markers: Ints, points: Floats) -> None: ...
    # (other markers, frames seen together, mean distances, their variances, predictive variances)
    def of(self, marker: int) -> tuple[Ints, Ints, Floats, Floats, Floats]: ...

class StitchOptions:
    def __init__(
        self,
        *,
        noise: float,
        ghost_radius: float,
        confirm: int,
        max_gap: int,
        max_occlusion: int,
        may_cut: bool,
    ) -> None: ...

class Stitcher:
    ODDS_FACTOR: float
    def __init__(self, motion: MotionModel, options: StitchOptions) -> None: ...
    def advise(self, labels: Ints, before: Ints, weights: Floats) -> None: ...
    # tracklet of each point of the next frames
    def run(
        self,
        times: Floats,
        kind: Shorts,
        F: Floats,
        Q: Floats,
        offsets: Ints,
        points: Floats,
        labels: Ints,
    ) -> Shorts: ...
    # for each tracklet its marker, the previous tracklet, and the probability
    def finish(self) -> tuple[Shorts, Shorts, Floats]: ...
    n_cuts: Final[int]
    n_markers: Final[int]

class LiveStitcher:
    def __init__(self, motion: MotionModel, options: StitchOptions, *, lag: int) -> None: ...
    # (markers, earlier detections whose marker changes, their markers)
    def step(
        self,
        F: Floats,
        Q: Floats,
        points: Floats,
        labels: Ints,
        revised: Ints,
        revised_labels: Ints,
    ) -> tuple[Ints, Ints, Ints]: ...
    def copy(self) -> LiveStitcher: ...
    # Does the part of the next step that seldom depends on its frame.
    def look_ahead(self) -> None: ...
    # As `tracks` of a tracker, of the markers, from that of the tracker of the labels.
    def states(
        self, labels: Ints, gaps: Ints, log_odds: Floats, means: Floats, covariances: Floats
    ) -> tuple[Ints, Ints, Floats, Floats, Floats]: ...
    n_seen: Final[int]
    n_joins: Final[int]
    n_ghosts: Final[int]
    n_cuts: Final[int]
    n_markers: Final[int]
    n_remembered: Final[int]

class NameEvidence:
    def __init__(
        self,
        *,
        distances: Floats,
        movements: Floats,
        variations: Floats,
        prior: Floats,
        quads: Ints,
        heights: Floats,
        pairs: Ints,
        pair_distances: Floats,
        pair_spreads: Floats,
        positions: Floats,
        spreads: Floats,
        size: float,
        weights: Floats,
        none: float,
    ) -> None: ...
    @property
    def n_markers(self) -> int: ...
    def scores(self, names: Ints) -> Floats: ...
    def total(self, names: Ints) -> float: ...

class NameSearch:
    def __init__(
        self,
        evidence: NameEvidence,
        *,
        groups: list[list[int]],
        partner: Ints,
        near: list[list[int]],
    ) -> None: ...
    def settled(self, names: Ints) -> tuple[Ints, float]: ...
    def improved(self, names: Ints) -> tuple[Ints, float]: ...

def window_scores(
    points: Floats,
    *,
    rows: Ints,
    holder: Ints,
    neighbours: Ints,
    distances: Floats,
    variances: Floats,
    weights: Floats,
) -> Floats: ...

# Median distances between K tracks, their spreads, and their numbers of frames, each (K, K).
def distances_between(positions: Floats) -> tuple[Floats, Floats, Ints]: ...

# Exchanges of two tracks: (track, other track, first frame, frame after the last).
def exchanges_by_distances(
    positions: Floats, *, min_frames: int
) -> list[tuple[int, int, int, int]]: ...

# Number, sum and sum of squares of distances between markers, with those of one more frame.
def with_distances(
    sums: Floats, marker_of: dict[int, int], points: Floats, labels: Ints
) -> Floats: ...

# Neighbours of markers, their distances, variances and weights, each (n, R).
def measured_neighbours(
    markers: Ints,
    *,
    size: float,
    is_kept: bool,
    distances: Floats,
    movements: Floats,
    variations: Floats,
    middle: Floats,
    spread: Floats,
    n_frames: Floats,
) -> tuple[Ints, Floats, Floats, Floats]: ...

# Tracks of the last of some frames of (points, labels), numbered by label from 0 on.
class LastTracks:
    def __init__(
        self,
        frames: Sequence[tuple[Floats, Ints]],
        marker_of: dict[int, int],
        *,
        neighbours: Ints,
        distances: Floats,
        variances: Floats,
        weights: Floats,
    ) -> None: ...
    def named(self, turn: int) -> int: ...
    def new(self, turn: int) -> int: ...
    def label(self, k: int) -> int: ...
    def marker(self, k: int) -> int: ...
    def holder(self, m: int) -> int: ...
    def best_free(self, k: int, *, none: float, temperature: float) -> tuple[int, float, float]: ...
    def better(self, k: int, *, none: float) -> tuple[int, float]: ...

class StartOptions:
    def __init__(
        self,
        *,
        gate: float,
        min_detections: int,
        max_missed: int,
        min_score: float,
        max_chains: int,
    ) -> None: ...

def packed_width(model: MotionModel) -> int: ...
def predict_tracks(
    model: MotionModel, *, gate: float, F: Floats, Q: Floats, states: Floats, n_threads: int
) -> tuple[Floats, Floats]: ...
def solve_tile(
    model: MotionModel,
    score: ScoreModel,
    *,
    gate: float,
    max_candidates: int,
    times: Floats,
    F: Floats,
    Q: Floats,
    states: Floats,
    regions: Floats,
    last: Floats,
    last_times: Floats,
    scores: Floats,
    gaps: Shorts,
    is_confirmed: NDArray[np.uint8],
    offsets: Ints,
    points: Floats,
    is_shared: NDArray[np.uint8],
) -> tuple[Shorts, Shorts, Shorts, Floats, tuple[int, int, int]]: ...
def solve_joined(
    *, rows: Shorts, columns: Shorts, gains: Floats, n_tracks: int, n_points: int
) -> tuple[Shorts, tuple[int, int, int]]: ...
def update_tracks(
    model: MotionModel,
    score: ScoreModel,
    *,
    states: Floats,
    scores: Floats,
    gaps: Shorts,
    match: Shorts,
    points: Floats,
    n_threads: int,
) -> tuple[Floats, Floats]: ...
def find_starts(
    model: MotionModel,
    score: ScoreModel,
    options: StartOptions,
    *,
    times: Floats,
    F: Floats,
    Q: Floats,
    offsets: Ints,
    points: Floats,
    n_threads: int,
) -> tuple[Shorts, Floats, Floats, Shorts]: ...
