"""The k best set packings of the engine against every packing, sorted."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import asterism as am
from asterism import _engine


def arrays(trees):
    """Trees of options, each a worth and the resources that it uses, as the engine takes them."""
    options = [option for tree in trees for option in tree]
    return (
        np.cumsum([0] + [len(tree) for tree in trees]),
        np.array([worth for worth, _ in options]),
        np.cumsum([0] + [len(uses) for _, uses in options]),
        np.array([r for _, uses in options for r in uses], dtype=np.int32),
    )


def pack(trees, k: int, drop: float = 1e9, max_nodes: int = 10**6):
    return _engine.pack(*arrays(trees), k, drop, max_nodes)


def every_packing(trees):
    found = []
    for choice in itertools.product(*(range(len(tree)) for tree in trees)):
        used = [r for tree, o in zip(trees, choice, strict=True) for r in tree[o][1]]
        if len(set(used)) == len(used):
            found.append((sum(t[o][0] for t, o in zip(trees, choice, strict=True)), choice))
    return sorted(found, key=lambda pair: -pair[0])


def random_trees(rng, n_trees: int, n_options: int, n_resources: int, *, ties: bool = False):
    trees = []
    for _ in range(n_trees):
        tree = [(float(rng.normal(-3, 1)), [])]
        for _ in range(rng.integers(0, n_options + 1)):
            uses = rng.choice(n_resources, rng.integers(1, min(4, n_resources + 1)), replace=False)
            worth = float(rng.normal(2, 3))
            tree.append((round(worth) if ties else worth, uses.tolist()))
        trees.append([tree[i] for i in rng.permutation(len(tree))])
    return trees


@pytest.mark.parametrize("seed", range(10))
def test_equals_sorted_enumeration(seed):
    rng = np.random.default_rng(seed)
    for k in range(60):
        trees = random_trees(
            rng, int(rng.integers(0, 6)), 4, int(rng.integers(1, 7)), ties=k % 3 == 0
        )
        wanted = every_packing(trees)
        n = int(rng.choice([1, 5, 1000]))
        chosen, totals, is_exact, bound, _ = pack(trees, n)
        assert is_exact
        assert len(totals) == min(n, len(wanted))
        assert np.allclose(totals, [t for t, _ in wanted[:n]], rtol=0, atol=1e-9)
        assert bound == pytest.approx(wanted[0][0], abs=1e-9)
        sums = {choice: total for total, choice in wanted}
        rows = [tuple(row) for row in chosen.tolist()]
        assert len(set(rows)) == len(rows)
        assert np.allclose([sums[row] for row in rows], totals, rtol=0, atol=1e-9)


def test_equals_the_exact_solver_where_there_are_many():
    rng = np.random.default_rng(3)
    for _ in range(20):
        trees = random_trees(rng, 25, 5, 40)
        # A tree is one more resource, which each of its options uses; worths against the free one.
        tuples, weights, free = [], [], 0.0
        for i, tree in enumerate(trees):
            none = max(worth for worth, uses in tree if not uses)
            free += none
            for worth, uses in tree:
                row = np.full(41, -1)
                row[0] = i
                row[1 + np.array(uses, dtype=int)] = 0
                tuples.append(row)
                weights.append(worth - none)
        exact = am.solve.assign_multidimensional(tuples, weights)
        _, totals, is_exact, _, _ = pack(trees, 1)
        assert is_exact
        assert totals[0] == pytest.approx(exact.value + free, abs=1e-6)


def test_a_limit_on_nodes_gives_a_packing_and_a_bound():
    rng = np.random.default_rng(5)
    trees = random_trees(rng, 30, 6, 30)
    _, totals, _, _, n_nodes = pack(trees, 1)
    assert n_nodes > 20
    chosen, value, is_exact, bound, _ = pack(trees, 1, max_nodes=5)
    assert not is_exact
    assert value[0] <= totals[0] <= bound
    used = [r for tree, o in zip(trees, chosen[0], strict=True) for r in tree[o][1]]
    assert len(set(used)) == len(used)


def test_what_falls_too_far_below_the_best_is_left_out():
    trees = [[(0.0, []), (3.0, [0]), (2.5, [1])], [(0.0, []), (1.0, [0])]]
    assert pack(trees, 10)[1].tolist() == [3.5, 3.0, 2.5, 1.0, 0.0]
    assert pack(trees, 10, drop=0.7)[1].tolist() == [3.5, 3.0]


def test_the_engine_refuses_what_would_corrupt_memory():
    with pytest.raises(ValueError, match="uses nothing"):
        pack([[(1.0, [0])]], 1)
    with pytest.raises(ValueError, match="from 0"):
        pack([[(1.0, [-1]), (0.0, [])]], 1)


@pytest.mark.parametrize("seed", range(6))
def test_no_packing_gains_more_than_the_bound_less_any_of_its_losses(seed):
    rng = np.random.default_rng(500 + seed)
    gaps = []
    for _ in range(60):
        trees = random_trees(rng, int(rng.integers(1, 6)), 4, int(rng.integers(2, 7)))
        bound, losses = _engine.packing_losses(*arrays(trees))
        of = np.split(losses, np.cumsum([len(tree) for tree in trees])[:-1])
        packings = every_packing(trees)
        assert (losses >= 0).all()
        for worth, choice in packings:
            lost = max(float(of[i][o]) for i, o in enumerate(choice))
            assert worth <= bound - lost + 1e-9
        gaps.append(bound - packings[0][0])
    assert min(gaps) > -1e-9
    assert np.mean(np.array(gaps) < 1e-3) > 0.7  # without prices half of them have a gap


@pytest.mark.parametrize("seed", range(4))
def test_large_sparse_problems_close_the_gap_and_are_packings(seed):
    # Six hundred options of forty trees: the prices of a plain subgradient left tens of nats.
    rng = np.random.default_rng(900 + seed)
    trees = []
    for _ in range(40):
        tree = [(0.0, [])]
        for _ in range(15):
            uses = rng.choice(120, rng.integers(1, 6), replace=False)
            tree.append((float(rng.normal(4, 3)), uses.tolist()))
        trees.append(tree)
    chosen, worth, _, bound, _ = pack(trees, 1, max_nodes=2000)
    used = [r for tree, o in zip(trees, chosen[0], strict=True) for r in tree[o][1]]
    assert len(used) == len(set(used))
    assert worth[0] == pytest.approx(sum(t[o][0] for t, o in zip(trees, chosen[0], strict=True)))
    assert bound - worth[0] < 0.05 * worth[0]
