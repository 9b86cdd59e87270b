"""Distance bonds as a term of the posterior: that the chain samples it, and what it is good for."""

from __future__ import annotations

import numpy as np
import pytest

from bond_oracle import Bonds, some_bonds
from chain_oracle import Oracle, as_partition, make_chain
from partition_oracle import every_partition, tiny_model, tiny_problem
from test_chain import FLOOR, STOP, problem_of_size, total_variation


def bonded(seed, *, settled=None, weight=4.0, size=(500, 5000), n_axes=2):
    """A problem, a chain that weighs bonds in it, and the bonds."""
    d, model = problem_of_size(*size, seed, n_axes)
    chain = make_chain(d, model, informed=True, seed=1, stop=STOP, floor=FLOOR)
    if settled is not None:
        chain.run(1000)
        chain.freeze(settled)
    bonds = some_bonds(d, seed, settled=settled, weight=weight)
    bonds.give_to(chain)
    return d, model, chain, bonds


@pytest.mark.parametrize(("seed", "n_axes"), [(0, 2), (100, 3)])
def test_the_chain_visits_partitions_as_often_as_they_are_probable_with_bonds(seed, n_axes):
    d, model, chain, bonds = bonded(seed, n_axes=n_axes)
    more = np.array([bonds.total(d, tracks) for tracks in every_partition(d, model)[0]])
    assert np.ptp(more) > 4
    distance, _ = total_variation(d, model, chain, 3_200_000, more=lambda w: bonds.total(d, w))
    assert distance < 0.02
    # They matter: without them it would be elsewhere.
    other, _ = total_variation(d, model, chain, 100_000)
    assert other > 0.1


@pytest.mark.parametrize("seed", [40, 50, 60])
def test_settled_tracks_are_the_markers_of_the_rest(seed):
    d, model, chain, bonds = bonded(seed, settled=1)
    settled = chain.labels()
    distance, n_left = total_variation(
        d, model, chain, 1_000_000, settled=(1, settled), more=lambda w: bonds.total(d, w)
    )
    assert n_left > 10
    assert distance < 0.02
