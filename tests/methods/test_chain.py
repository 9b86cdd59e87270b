"""The chain of MCMC data association: every move's probability, and the posterior it samples."""

from __future__ import annotations

import math

import numpy as np
import pytest

import asterism as am
from tests.references.chain_moves import (
    FLOOR,
    INVERSE,
    MOVES,
    STOP,
    Oracle,
    as_partition,
    make_chain,
)
from tests.references.partitions import every_partition, problem_of_size, tiny_model, tiny_problem
from tests.references.visits import total_variation
from tests.scenes import small_model


def traced(seed, *, informed, frozen, n=400):
    """A problem, and moves of a chain on it that were weighed to the end."""
    rng = np.random.default_rng(seed)
    d, model = tiny_problem(rng, 5, 4, 2 + seed % 2), tiny_model(rng)
    chain = make_chain(d, model, informed=informed, seed=seed, stop=STOP, floor=FLOOR)
    chain.run(200)
    if frozen >= 0:
        chain.freeze(frozen)
    return d, model, chain.trace(n)


def problems(frozen_zones=(-1, 1), seeds=range(12)):
    for seed in seeds:
        for informed in (False, True):
            for frozen in frozen_zones:
                d, model, moves = traced(seed, informed=informed, frozen=frozen)
                yield d, model, {"informed": informed, "frozen": frozen}, moves


def compared_moves(oracle_class):
    """Each move, the settled frames, and whether its probabilities are those of the oracle."""
    for d, model, how, moves in problems():
        oracle = oracle_class(d, model, stop=STOP, floor=FLOOR, **how)
        for move, with_, before, after, log_forward, log_reverse, *_ in moves:
            name, w, v = MOVES[move], as_partition(before), as_partition(after)
            forward = oracle.log_q(name, with_, w, v)
            if forward is None:
                continue
            back = oracle.log_q(INVERSE.get(name, name), oracle.with_back(name, with_, w, v), v, w)
            is_right = abs(forward - log_forward) <= 1e-9 and abs(back - log_reverse) <= 1e-9
            yield name, how["frozen"], is_right


def test_forward_and_back_are_the_probabilities_counted_by_hand():
    compared = set(compared_moves(Oracle))
    assert compared == {(move, frozen, True) for move in MOVES for frozen in (-1, 1)}


class DeathWithoutItsOwn(Oracle):
    def of_birth(self, w, v, _):  # |F| for |F| + n on the way back of a death
        (new,) = v - w
        free = self.free(w)
        return -math.log(max(len(free - set(new)), 1)) + self.growth(new, 1, free, forced=True)


class BirthWithoutTheNewOne(Oracle):
    def of_death(self, w, v, _):  # K for K + 1 on the way back of a birth
        return -math.log(max(sum(self.n_frozen(t) == 0 for t in w) - 1, 1))


class NoLookAtEmptyGaps(Oracle):
    def uniform_step(self, path, i, j, free, *, forced):
        return self.stop if j is None else super().uniform_step(path, i, j, free, forced=forced)


class ExtensionForFree(Oracle):
    def of_extension(self, w, v, _):
        return 0.0


class ReductionForFree(Oracle):
    def of_reduction(self, w, v, _):
        return 0.0


class UpdateAsLongAsBefore(Oracle):
    def of_update(self, w, v, keep):  # 1/n both ways
        log_q = super().of_update(w, v, keep)
        if log_q is None:
            return None
        (new,), (old,) = v - w, w - v
        return log_q + math.log(len(old)) - math.log(len(new))


class UpdateForFree(Oracle):
    def of_update(self, w, v, keep):
        return None if w == v else 0.0


class SwitchPartnersInTheOldTracks(Oracle):
    def of_switch(self, w, v, b):  # s as if the tails had not changed tracks
        links = {y: x for x, y in self.links(w)}
        a = links[b]
        (own,) = [t for t in w if a in t]
        (mine,) = [t for t in v if a in t]
        partners = [d for d in self.partners(w, own, a, b) if d not in mine]
        return -math.log(len(links)) - math.log(max(len(partners), 1))


class SplitForgetsWhoElseBegins(Oracle):
    def of_merge(self, w, v, _):  # c' = 1
        return -math.log(len(w))


class MergeForgetsWhereItMayBeCut(Oracle):
    def of_split(self, w, v, _):
        return -math.log(len(w))


class DeletionForgetsOtherSlots(Oracle):
    def of_insertion(self, w, v, _):
        return -math.log(len(self.free(w)))


class SettledDetectionsAreFree(Oracle):
    def is_frozen(self, i):
        return False


@pytest.mark.parametrize(
    "mistake",
    [
        DeathWithoutItsOwn, BirthWithoutTheNewOne, NoLookAtEmptyGaps, ExtensionForFree,
        ReductionForFree, UpdateAsLongAsBefore, UpdateForFree, SwitchPartnersInTheOldTracks,
        SplitForgetsWhoElseBegins, MergeForgetsWhereItMayBeCut, DeletionForgetsOtherSlots,
        SettledDetectionsAreFree,
    ],
)  # fmt: skip
def test_known_mistakes_would_be_seen(mistake):
    assert not all(is_right for _, _, is_right in compared_moves(mistake))


def test_gains_and_values_are_those_of_the_posterior_and_refused_moves_change_nothing():
    n_refused = 0
    for d, model, how, moves in problems(seeds=range(6)):
        oracle = Oracle(d, model, stop=STOP, floor=FLOOR, **how)
        previous = None
        for _, _, before, after, _, _, gain, is_taken, value in moves:
            w, v = as_partition(before), as_partition(after)
            assert value == pytest.approx(oracle.total(w), abs=1e-9)
            assert gain == pytest.approx(oracle.total(v) - oracle.total(w), abs=1e-9)
            if previous is not None:
                labels, old_value = previous
                assert (before == labels).all()
                assert old_value is None or value == old_value  # to the last bit
            previous = (after, None) if is_taken else (before, value)
            n_refused += not is_taken
    assert n_refused > 500


@pytest.mark.parametrize("informed", [False, True], ids=["uniform", "informed"])
@pytest.mark.parametrize(("seed", "n_axes"), [(0, 2), (100, 3)])
def test_the_chain_visits_partitions_as_often_as_they_are_probable(informed, seed, n_axes):
    d, model = problem_of_size(500, 5000, seed, n_axes)
    tv = []
    for n in (25_000, 800_000):
        chain = make_chain(d, model, informed=informed, seed=1)
        distance, n_partitions = total_variation(d, model, chain, n)
        tv.append(distance)
    assert n_partitions >= 500
    # Noise of the counts alone, which falls as 1/√n; a wrong ratio stays.
    assert tv[1] < 0.02
    assert tv[1] < tv[0] / 2.5


@pytest.mark.parametrize("informed", [False, True], ids=["uniform", "informed"])
@pytest.mark.parametrize(
    "move", ["split", "extension", "update", "switch", "insertion", "transfer", "replacement",
             "exchange", "relocation"],
)  # fmt: skip
def test_each_move_is_right_beside_birth_and_death_alone(move, informed):
    d, model = problem_of_size(150, 1500, 7, 2)
    weights = [name in ("birth", "death", move, INVERSE.get(move)) for name in MOVES]
    chain = make_chain(d, model, informed=informed, weights=weights, seed=2)
    assert total_variation(d, model, chain, 500_000)[0] < 0.025


def test_unequal_shares_and_the_first_rules_change_nothing():
    d, model = problem_of_size(150, 1500, 20, 3)
    for first_rules in (False, True):
        weights = np.linspace(1, 3, len(MOVES))
        chain = make_chain(
            d, model, informed=True, weights=weights, first_rules=first_rules, seed=3
        )
        assert total_variation(d, model, chain, 1_000_000)[0] < 0.02


@pytest.mark.parametrize("seed", [0, 1])
def test_settled_frames_stay_and_the_rest_is_sampled_given_them(seed):
    d, model = problem_of_size(500, 5000, 40 + 10 * seed, 2)
    chain = make_chain(d, model, informed=True, seed=seed)
    chain.run(1000)
    chain.freeze(1)
    settled = chain.labels()
    distance, n_left = total_variation(d, model, chain, 1_000_000, settled=(1, settled))
    assert n_left > 10
    assert distance < 0.02


def test_several_motions_are_sampled_as_well():
    rng = np.random.default_rng(5)
    single = [am.DWNA(acceleration_sigma=a, velocity_sigma=0.4) for a in (0.5, 2.0, 8.0)]
    motion = am.InteractingMotions(
        models=tuple(single), transitions=np.full((3, 3), 0.1) + 0.7 * np.eye(3)
    )
    d = tiny_problem(rng, 4, 3)
    while not 7 <= d.n_points <= 8:
        d = tiny_problem(rng, 4, 3)
    model = small_model(
        motion=motion, noise_sigma=0.01, clutter_density=20.0, birth_density=5.0, p_disappear=0.1,
        max_speed=4.0, max_gap=2, p_detection=0.8,
    )  # fmt: skip
    chain = make_chain(d, model, informed=True, seed=1)
    distance, n_partitions = total_variation(d, model, chain, 1_000_000)
    assert n_partitions > 50
    assert distance < 0.02


def test_the_ascent_of_the_report_climbs_and_does_not_sample():
    d, model = problem_of_size(500, 5000, 0, 2)
    _, totals = every_partition(d, model)
    chain = make_chain(d, model, informed=True, ascent=True, seed=4)
    values = []
    for _ in range(50):
        chain.run(200)
        values.append(chain.log_posterior())
    assert (np.diff(values) >= -1e-9).all()
    assert values[-1] == pytest.approx(totals.max(), abs=1e-9)
    assert total_variation(d, model, chain, 100_000)[0] > 0.3


def test_same_seed_same_chain():
    d, model = problem_of_size(500, 5000, 0, 2)
    runs = []
    for seed in (1, 1, 2):
        chain = make_chain(d, model, informed=True, seed=seed)
        chain.run(10_000)
        runs.append((chain.labels().tolist(), [move[:2] for move in chain.trace(100)]))
    assert runs[0] == runs[1] != runs[2]


def test_a_chain_begins_at_the_labels_assigned_to_it():
    d, model = problem_of_size(500, 5000, 0, 2)
    partitions, totals = every_partition(d, model)
    labels = np.full(d.n_points, -1)
    for k, track in enumerate(partitions[int(totals.argmax())]):
        labels[list(track)] = k
    chain = make_chain(d, model, informed=True)
    chain.run(100)
    chain.assign(labels)
    assert as_partition(chain.labels()) == as_partition(labels)
    assert chain.log_posterior() == pytest.approx(totals.max(), abs=1e-9)
    with pytest.raises(ValueError, match="at least two"):
        chain.assign(np.where(np.arange(d.n_points) == 0, 0, -1))
