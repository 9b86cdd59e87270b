"""Distance bonds as a term of the posterior: that the chain samples it, and what it is good for."""

from __future__ import annotations

import numpy as np
import pytest

import asterism as am
from tests.references.bonds import Bonds, some_bonds
from tests.references.chain_moves import FLOOR, STOP, Oracle, as_partition, make_chain
from tests.references.partitions import every_partition, problem_of_size, tiny_model, tiny_problem
from tests.references.visits import total_variation
from tests.scenes import small_model, wanderers


def bonded_chain(d, model, bonds_class=Bonds, *, seed=0, informed=True, settled=None, weight=10.0):
    """A chain that weighs bonds of some detections, and the bonds as the oracle knows them."""
    chain = make_chain(d, model, informed=informed, seed=seed, stop=STOP, floor=FLOOR)
    if settled is not None:
        chain.run(1000)
        chain.freeze(settled)
    bonds = some_bonds(d, seed, settled=settled, weight=weight, of=bonds_class)
    bonds.give_to(chain)
    return chain, bonds


@pytest.mark.parametrize(("seed", "n_axes"), [(0, 2), (100, 3)])
def test_the_chain_visits_partitions_as_often_as_they_are_probable(seed, n_axes):
    d, model = problem_of_size(500, 5000, seed, n_axes)
    chain, bonds = bonded_chain(d, model, seed=1)
    said = [bonds.total(d, tracks) for tracks in every_partition(d, model)[0]]
    assert np.ptp(said) > 10
    distance, _ = total_variation(d, model, chain, 3_200_000, more=lambda w: bonds.total(d, w))
    assert distance < 0.02
    # They matter: the common posterior is elsewhere.
    assert total_variation(d, model, chain, 200_000)[0] > 0.1


@pytest.mark.parametrize("seed", [40, 50])
def test_settled_tracks_are_the_markers_of_the_rest(seed):
    d, model = problem_of_size(500, 5000, seed, 2)
    chain, bonds = bonded_chain(d, model, settled=1)
    distance, n_left = total_variation(
        d, model, chain, 1_000_000, settled=(1, chain.labels()), more=lambda w: bonds.total(d, w)
    )
    assert n_left > 10
    assert distance < 0.02


def wrong_gains(bonds_class=Bonds, seeds=range(8), n=400):
    """Count moves whose gain is not what the oracle has, and those of which bonds say something."""
    n_wrong, n_moves, n_said = 0, 0, 0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        d, model = tiny_problem(rng, 5, 4, 2 + seed % 2), tiny_model(rng)
        if d.n_points < 6:
            continue
        settled = 1 if seed % 4 == 3 else None
        chain, bonds = bonded_chain(
            d, model, bonds_class, seed=seed, informed=seed % 3 > 0, settled=settled
        )
        frozen = -1 if settled is None else settled
        oracle = Oracle(d, model, informed=seed % 3 > 0, stop=STOP, floor=FLOOR, frozen=frozen)
        previous = None
        for _, _, before, after, _, _, gain, is_taken, value in chain.trace(n):
            w, v = as_partition(before), as_partition(after)
            said = bonds.total(d, v) - bonds.total(d, w)
            n_wrong += abs(oracle.total(v) - oracle.total(w) + said - gain) > 1e-9
            n_wrong += abs(oracle.total(w) + bonds.total(d, w) - value) > 1e-9
            if previous is not None:
                n_wrong += value != previous  # a move that was refused leaves all as it was
            previous = None if is_taken else value
            n_said += abs(said) > 1e-3
            n_moves += 1
    assert n_moves > 500
    return n_wrong, n_said


def test_gains_are_those_of_the_posterior_with_bonds():
    n_wrong, n_said = wrong_gains()
    assert n_wrong == 0
    assert n_said > 300


class PairsTwice(Bonds):
    def total(self, d, partition):
        return 2 * super().total(d, partition)


class TheOtherWayRound(Bonds):
    def says(self, k, distance):
        return -super().says(k, distance)


class TailsKeepTheirNames(Bonds):
    def total(self, d, partition):  # each detection by the last that is known, not by the first
        return super().total(d, [track[::-1] for track in partition])


class BondsOfWhoIsSettledToo(Bonds):
    def total(self, d, partition):
        frozen, self.frozen = self.frozen, -1
        total = super().total(d, partition)
        self.frozen = frozen
        return total + (frozen >= 0)


class AllBondsAlike(Bonds):
    def says(self, k, distance):  # w for w / n
        return super().says(k, distance) * self.few


class NoBonds(Bonds):
    def total(self, d, partition):
        return 0.0


@pytest.mark.parametrize(
    "mistake",
    [PairsTwice, TheOtherWayRound, TailsKeepTheirNames, BondsOfWhoIsSettledToo, AllBondsAlike,
     NoBonds],
)  # fmt: skip
def test_known_mistakes_would_be_seen(mistake):
    n_wrong, _ = wrong_gains(mistake)
    assert n_wrong > 0


@pytest.mark.parametrize("mistake", [PairsTwice, TheOtherWayRound, TailsKeepTheirNames, NoBonds])
def test_known_mistakes_would_be_seen_in_the_visits(mistake):
    d, model = problem_of_size(500, 5000, 0, 2)
    chain, bonds = bonded_chain(d, model, mistake, seed=1)
    distance, _ = total_variation(d, model, chain, 400_000, more=lambda w: bonds.total(d, w))
    assert distance > 0.04


def test_what_is_kept_move_by_move_is_what_is_read_anew():
    for seed in (3, 7, 11):
        d = am.simulate.cube(frames=12, seed=seed).detections
        model = small_model(
            motion=am.DWNA(acceleration_sigma=0.05, velocity_sigma=0.1), max_speed=0.3,
            noise_sigma=0.02, clutter_density=5.0, birth_density=0.5, max_gap=4,
        )  # fmt: skip
        chain, _ = bonded_chain(d, model, seed=seed, weight=3.0)
        for _ in range(20):
            chain.run(5000)
            kept, anew = chain.bond_term()
            assert kept == anew != 0  # to the last bit


def test_same_seed_same_chain():
    d, model = problem_of_size(500, 5000, 0, 2)
    ends = []
    for _ in range(2):
        chain, _ = bonded_chain(d, model, seed=4)
        chain.run(10_000)
        ends.append((chain.labels().tolist(), chain.bond_term(), chain.counts().tolist()))
    assert ends[0] == ends[1]


@pytest.mark.parametrize(
    ("pairs", "lengths", "known", "text"),
    [([[1, 0]], [[1, 1]], [0, 1], "a < b"), ([[0, 2]], [[1, 1]], [0, 1], "known markers"),
     ([[0, 1]], [[1, 0]], [0, 1], "above 0"), ([[0, 1]], [[1, 1]], [0], "one for each"),
     ([[0, 1]], [[1, 1]], [1, 1], "one detection")],
)  # fmt: skip
def test_bonds_of_a_chain_are_checked(pairs, lengths, known, text):
    d = am.Detections.from_frames([0.0, 0.1], [np.zeros((1, 3)), np.zeros((1, 3))])
    chain = make_chain(d, small_model(), informed=True)
    bonds = Bonds(pairs, lengths, 1.0, known)
    with pytest.raises(ValueError, match=text):
        bonds.give_to(chain)


def body_in_bursts(seed=1, frames=120):
    truth = am.simulate.person(seed=seed, frames=frames)
    return am.simulate.corrupt(
        truth, burst=am.simulate.Burst(), ghosts=am.simulate.Ghosts(), noise=3e-4, seed=seed
    )


def test_bonds_keep_identities_where_markers_hide_among_ghosts():
    wrong = {0.0: 0, 5.0: 0}
    for seed in (1, 2):
        truth = body_in_bursts(seed)
        model = am.tracking.tracklet_model(am.estimate_model(truth.detections).model)
        for weight in wrong:
            tracks = am.track(truth.detections, am.MCMCDA(bond_weight=weight), model=model)
            wrong[weight] += am.evaluate(tracks, truth).wrong_links
            assert ("bonds" in tracks.info) == (weight > 0)
            if weight > 0:
                assert tracks.info["bonds"] > 20
                assert tracks.info["bond_score"] > 0
    assert wrong[5.0] <= wrong[0.0]


def test_whoever_keeps_no_distance_is_left_alone():
    for seed in range(3):
        truth = wanderers(np.random.default_rng(seed), n_frames=120)
        tracks = [
            am.track(truth.detections, am.MCMCDA(bond_weight=w), model=small_model())
            for w in (0, 5)
        ]
        idf1 = [am.evaluate(t, truth).idf1 for t in tracks]
        assert idf1[1] >= idf1[0] - 0.001


def test_the_value_that_is_told_is_the_common_one():
    truth = body_in_bursts()
    model = am.tracking.tracklet_model(am.estimate_model(truth.detections).model)
    tracks = am.track(truth.detections, am.MCMCDA(bond_weight=5), model=model)
    assert tracks.info["log_posterior"] == pytest.approx(am.log_posterior(tracks, model))


@pytest.mark.parametrize("options", [{}, {"groups": "whole"}, {"window": None, "moves": 10}])
def test_neither_threads_nor_the_way_of_running_change_a_byte(options):
    truth = body_in_bursts(frames=60)
    d, model = (
        truth.detections,
        am.tracking.tracklet_model(am.estimate_model(truth.detections).model),
    )
    runs = [
        am.track(d, am.MCMCDA(bond_weight=5, threads=n, **options), model=model, seed=2)
        for n in (1, 3)
    ]
    if "window" not in options:
        method = am.MCMCDA(bond_weight=5, **options)
        state = method.init(model, seed=2)
        labels = np.full(d.n_points, -1)
        n = 0
        for now, points in d:
            state, update = method.step(state, now, points)
            labels[update.revised] = update.revised_labels
            labels[n : n + len(points)] = update.labels
            n += len(points)
        assert (labels == runs[0].labels).all()
    assert (runs[0].labels == runs[1].labels).all()
    assert (runs[0].confidence == runs[1].confidence).all()
    assert runs[0].info["bond_score"] == runs[1].info["bond_score"] > 0


@pytest.mark.parametrize("weight", [-1, 101, float("nan"), "much"])
def test_the_weight_is_checked(weight):
    with pytest.raises(am.ParameterError, match="bond_weight"):
        am.MCMCDA(bond_weight=weight)
