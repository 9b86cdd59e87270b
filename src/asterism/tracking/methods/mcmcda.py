"""Markov chain Monte Carlo data association (§2.5, §4 of the report; Oh, Russell & Sastry 2009)."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

import numpy as np

from asterism.checks import check_array, check_fields, check_kind, check_number
from asterism.errors import ParameterError
from asterism.model.shared_acceleration import SharedAcceleration
from asterism.records import record
from asterism.tracking.methods.chain_options import ChainOptions
from asterism.tracking.methods.engine_method import EngineMethod, EngineState
from asterism.tracking.methods.mcmc_moves import MOVES, checked_weights

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from asterism import _engine
    from asterism.model import Detections, TrackingModel
    from asterism.tracking.methods.engine_method import Tracker

__all__ = ["MCMCDA"]

MAX_COUNT = 1_000_000
"""Largest number of moves per marker and frame, which take some seconds, and of window frames."""
FIRST_PASS = 10
"""Window of the first pass over a whole capture, which provides the start of the chains."""
BLOCK = 100
"""Number of frames of a block of a whole capture; blocks overlap by half."""
FLOOR = 1e-4
"""Smallest weight of a step of an informed extension; ending in the last frame has weight 1."""


@record
class MCMCDA(EngineMethod):
    """Markov chain Monte Carlo data association: sampling of the partitions of a window.

    A move proposes a new partition and is accepted with the Metropolis-Hastings probability, so the
    chain samples the posterior of partitions (`log_posterior`); the last moves of a search accept
    hardly anything but gains. In each frame the chain starts from the exact assignment of the new
    detections, or from given labels, and the best visited partition is kept. It decides the frame
    that leaves the window. Of decided frames only the filter states of the tracks are kept, so the
    cost of a frame does not grow with time.

    Until a frame is decided its labels are those of the best partition so far, and can change.

    Parameters
    ----------
    window : int or None
        Number of frames after which a frame is decided, ≥ 1; 1 is the single-scan form. Larger
        windows use more evidence and need more `moves`. None is for whole captures: after the last
        frame the chains process all frames again in blocks of 100 that overlap by half, each
        conditional on the frames before and after it. The time is linear in the length of the
        capture.
    moves : float or None
        Monte Carlo moves per frame and ambiguous detection (or track, if there are more tracks),
        ≥ 0. Larger values search longer. None for a `deadline` alone. 0 requires initial labels:
        it keeps them and estimates their confidence.
    deadline : float or None
        Time after the arrival of a frame at which the chain stops, seconds, > 0. Results then
        depend on the machine; None, the default, keeps them reproducible. ``info["moves"]`` counts
        the moves.
    confidence : float
        Monte Carlo moves for the confidence of labels, counted as `moves`; larger values make it
        more precise, and 0 switches it off. A confidence is the share of the chain in which a
        detection has the same predecessor (first detection of a track: the same successor; clutter:
        no track).
    end_odds : float
        Factor by which the termination probability is divided. Values above 1 keep a track through
        motion that the model does not predict, hence the default; 1 samples the model's own
        posterior.
    chains : int
        Number of parallel chains in each frame, 1 to 1024. The best partition of all is used, and
        with several chains ``info["rhat"]`` measures the convergence of the confidence.
    threads : int
        Number of chains that run at the same time, 1 to 1024. The result does not depend on it.
        With shared accelerations one group is sampled after the other, each by all chains.
    keep : {"best", "draw"}
        Partition of a chain that is kept: the best visited one, or the last one, which is drawn
        from the posterior of the open frames given the decided ones. Draws with different seeds
        show the remaining uncertainty; stochastic EM uses them.
    chain : ChainOptions
        Options of the chain: proposals, acceptance and groups.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=40, seed=1)
    >>> tracks = am.track(truth.detections, am.MCMCDA(window=5), seed=1)
    >>> tracks.n_tracks, bool(tracks.confidence.min() > 0.99)
    (8, True)

    Frame by frame, with new tracks that get their labels by `Update.revised`:

    >>> method = am.MCMCDA()
    >>> state = method.init(tracks.recipe.model, seed=1)
    >>> for time, points in truth.detections.part(0, 20):
    ...     state, update = method.step(state, time, points)
    >>> update
    Update(8 detections, 8 in tracks, 0 earlier labels revised, with confidence)
    >>> state, labels, confidence = method.run(state, truth.detections.part(20, 40))
    """

    window: int | None = 10
    moves: float | None = 100.0
    deadline: float | None = None
    confidence: float = 25.0
    end_odds: float = 1000.0
    chains: int = 1
    threads: int = 1
    keep: Literal["best", "draw"] = "best"
    chain: ChainOptions = ChainOptions()

    name: ClassVar[str] = "mcmcda"

    def __post_init__(self) -> None:
        if self.window is not None:
            check_number("window", self.window, above=1, below=MAX_COUNT, closed=True, integer=True)
        elif self.deadline is not None:
            raise ParameterError("deadline", "none for a whole capture", repr(self.deadline))
        if self.moves is not None:
            check_number("moves", self.moves, above=0, below=MAX_COUNT, closed=True)
        elif self.deadline is None:
            raise ParameterError("moves", "a number, or a deadline", "None")
        if self.deadline is not None:
            check_number("deadline", self.deadline, above=0)
        check_number("confidence", self.confidence, above=0, below=MAX_COUNT, closed=True)
        check_number("end_odds", self.end_odds, above=1, below=1e12, closed=True)
        check_number("chains", self.chains, above=1, below=1024, closed=True, integer=True)
        check_number("threads", self.threads, above=1, below=1024, closed=True, integer=True)
        check_fields("keep", [self.keep], ("best", "draw"))
        check_kind("chain", self.chain, ChainOptions, "am.tracking.ChainOptions()")
        if self.chain.acceptance == "ascent":
            hint = "use metropolis, the only acceptance that samples the posterior"
            if self.keep == "draw":
                raise ParameterError("keep", "'best' with the ascent", "'draw'", hint)
            if self.confidence > 0:
                raise ParameterError("confidence", "0 with the ascent", self.confidence, hint)

    @classmethod
    def report_2010(cls, *, window: int = 10, moves: float = 25.0, **changes: Any) -> Self:
        """Return the method with the chain of the 2010 report.

        Parameters
        ----------
        window : int
            Number of frames after which a frame is decided.
        moves : float
            Monte Carlo moves per frame and ambiguous detection.
        **changes
            Fields of `ChainOptions` that differ from those of the report.

        Returns
        -------
        MCMCDA

        Raises
        ------
        ParameterError
            If an option is unknown or impossible.

        Examples
        --------
        >>> import asterism as am
        >>> am.MCMCDA.report_2010(groups="cells", distance=0.5).chain.acceptance
        'ascent'
        """
        report: dict[str, Any] = {
            "proposal": "uniform", "move_weights": "report", "acceptance": "ascent",
            "first_rules": True, "assignment": False, "ambiguous_share": 0.0, "groups": "whole",
        }  # fmt: skip
        chain = ChainOptions(**report | changes)
        return cls(window=window, moves=moves, confidence=0.0, end_odds=1.0, chain=chain)

    def _tracker(self, model: TrackingModel, n_axes: int, seed: int | None) -> Tracker:
        from asterism import _engine
        from asterism.model.compiled import motion_model, score_model

        rules = self.chain
        weights = checked_weights(rules.move_weights)
        chain = _engine.ChainOptions(
            weights=np.array([weights.get(move, 0.0) for move in MOVES]),
            is_informed=rules.proposal == "informed",
            stop=model.population.p_disappear,
            floor=FLOOR,
            has_first_rules=rules.first_rules,
            is_ascent=rules.acceptance == "ascent",
            share_at_ambiguous=rules.ambiguous_share,
            is_draw=self.keep == "draw",
        )
        options = _engine.McmcOptions(
            window=FIRST_PASS if self.window is None else int(self.window),
            is_whole=self.window is None,
            block=BLOCK,
            moves=math.inf if self.moves is None else self.moves,
            deadline=self.deadline or 0.0,
            has_assignment=rules.assignment,
            confidence=self.confidence,
            chains=int(self.chains),
            threads=int(self.threads),
            split_by=getattr(_engine.SplitBy, rules.groups),
            ambiguous_within=rules.ambiguous_within,
            distance=rules.distance or 0.0,
            bonds=rules.bonds,
            tolerance=rules.bond_tolerance or 6 * math.sqrt(2) * model.sensor.noise_sigma,
        )
        is_one = len(model.motion.modes) == 1
        make = _engine.OneMotionTracker if is_one else _engine.SeveralMotionsTracker
        population = model.population
        rare = replace(population, p_disappear=population.p_disappear / self.end_odds)
        score = score_model(replace(model, population=rare))
        return make(motion_model(model, n_axes), score, chain, options, _checked_seed(seed))

    def init(
        self,
        model: TrackingModel,
        *,
        n_axes: int = 3,
        seed: int | None = None,
        start: ArrayLike | None = None,
        shared: SharedAcceleration | None = None,
    ) -> EngineState:
        """Return the state before the first frame; see `Method.init`.

        Parameters
        ----------
        model, n_axes, seed
            As for `Method.init`.
        start : array_like of int, shape (N,), optional
            Initial labels of the detections to come, -1 for a detection in no track. The chain
            starts from their tracks, without links that the model or earlier moves exclude, and
            from no others.
        shared : SharedAcceleration, optional
            How the markers of the labels accelerate together. A track is of the marker whose label
            the first of its labelled detections has, and the chain samples the posterior with
            `shared_gains`. Tracks of another group of the same frame are fixed meanwhile. A move
            whose own scores are more than 30 nats too small is rejected unseen. A whole capture is
            searched in blocks, given the markers before and after each.

        Returns
        -------
        EngineState

        Raises
        ------
        ParameterError
            If no track can start, neither by a move nor from a label, or `shared` is without labels
            or of others.

        Examples
        --------
        >>> import asterism as am
        >>> truth = am.simulate.cube(frames=20, seed=1)
        >>> method = am.MCMCDA(moves=0)  # keeps the labels and estimates their confidence
        >>> model = am.estimate_model(truth.detections).model
        >>> state = method.init(model, seed=1, start=truth.labels)
        >>> state, labels, confidence = method.run(state, truth.detections)
        >>> bool((labels == truth.labels).all()), float(confidence.min())
        (True, 1.0)
        """
        if self.moves == 0 and start is None:
            hint = "use gnn to associate frame by frame without moves"
            raise ParameterError("moves", "a number > 0, or labels to start from", "0", hint)
        if shared is not None and start is None:
            raise ParameterError("shared", "none without labels to start from", repr(shared))
        state = super().init(model, n_axes=n_axes, seed=seed)
        if start is not None:
            labels = check_array("start", start, ("N",), dtype=np.int64)
            _own(state).start_from(labels, self._compiled(shared, labels))
        return state

    def _compiled(
        self, shared: SharedAcceleration | None, labels: NDArray[np.int64]
    ) -> _engine.SharedAcceleration | None:
        if shared is None:
            return None
        check_kind("shared", shared, SharedAcceleration, "am.tracking.learn_shared_acceleration(…)")
        K = len(shared.weights)
        if labels.max(initial=-1) >= K:
            raise ParameterError(
                "shared", f"one marker for each label, up to {labels.max()}", f"{K}"
            )
        return shared.compiled

    def _check(self, state: EngineState, time: float, points: ArrayLike) -> None:
        del state, time, points
        if self.window is None:
            hint = "window=None is for whole captures, by run"
            raise ParameterError("window", "a number of frames", "None", hint)

    def run(
        self,
        state: EngineState,
        detections: Detections,
        *,
        progress: Callable[[int], Any] | None = None,
    ) -> tuple[EngineState, NDArray[np.int64], NDArray[np.float64] | None]:
        """Process all frames in the engine.

        Parameters
        ----------
        state, detections, progress
            As for `Method.run`.

        Returns
        -------
        state, labels, confidence
            Last state, label of every detection (N,), and confidences unless switched off.
        """
        check_kind("state", state, EngineState, "method.init(model)")
        if self.window is not None:
            return super().run(state, detections, progress=progress)
        T = detections.n_frames
        n_before = state.n_seen

        def tell(share: float) -> bool:
            if progress is not None:
                progress(int(T * share))
            return True

        # Most of the work is done after the last frame.
        part = 1 / (1 + FIRST_PASS)
        state, labels, sure = super().run(
            state, detections, progress=lambda t: tell(part * t / max(T, 1))
        )
        labels = np.concatenate([np.full(n_before, -1, dtype=np.int64), labels])
        confidence = np.zeros(len(labels) if sure is not None else 0)
        tracker = _own(state).copy()
        tracker.finish(labels, confidence, lambda share: tell(part + (1 - part) * share))
        tell(1.0)
        state = replace(state, tracker=tracker)
        return state, labels[n_before:], None if sure is None else confidence[n_before:]

    def _about(self, stats: _engine.FrameStats) -> dict[str, float]:
        from asterism import _engine

        assert isinstance(stats, _engine.SampledStats)
        chain = stats.chain
        drawn, _, taken = chain.moves.T
        about: dict[str, float] = {
            "tracks": stats.n_confirmed,
            "detections": stats.n_pending,
            "candidates": stats.n_candidates,
            "groups": stats.n_groups,
            "largest_group": stats.largest_group,
            "ambiguous_groups": chain.n_walked,
            "cut_links": chain.n_cut,
            "moves": chain.n_search,
        }
        about |= {
            f"accepted_{move}": float(n / max(all_, 1))
            for move, n, all_ in zip(MOVES, taken, drawn, strict=True)
        }
        if chain.n_given:
            about |= {"given_links": chain.n_given, "refused_links": chain.n_refused}
        if self.chain.bonds:
            about["sure_tracks"] = chain.n_sure
        if self.confidence > 0:
            about |= {
                "confidence_moves": chain.n_sampled,
                "disagreements": chain.n_disagreements,
                "unmoved_groups": chain.n_unmoved,
            }
            if not math.isnan(chain.rhat):
                about |= {"rhat": chain.rhat, "effective_samples": chain.ess}
        return about


def _own(state: EngineState) -> _engine.OneMotionTracker | _engine.SeveralMotionsTracker:
    from asterism import _engine

    assert isinstance(state.tracker, (_engine.OneMotionTracker, _engine.SeveralMotionsTracker))
    return state.tracker


def _checked_seed(seed: int | None) -> int:
    if seed is None:
        return 0
    check_number("seed", seed, above=0, below=2**64 - 1, closed=True, integer=True)
    return int(seed)
