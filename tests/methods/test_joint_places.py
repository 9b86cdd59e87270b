"""Joint decisions on the detections of bonded markers, against enumeration of all of them."""

import itertools

import numpy as np
import pytest

from asterism import _engine

LEAST, MOST, SHARED = -3.0, 8.0, -20.0


def log_tail(off, variance):
    return 2.5 * np.log1p(off**2 / (4 * variance))


def squared_scale(bond):
    _, _, n, mean, variance = bond
    n = min(n, 400)
    return (n * variance + 2 * (0.1 * mean) ** 2) / (n + 2)


def effects(scene, bond):
    """The effect of a bond for all pairs of detections, in nats."""
    a, b, _, mean, _ = bond
    V = squared_scale(bond)
    wide = V + scene["track_variances"][a] + scene["track_variances"][b]
    expected = np.linalg.norm(scene["centers"][a] - scene["centers"][b]) - mean
    base = np.log(wide / V) / 2 + log_tail(expected, wide)
    points = scene["points"]
    off = np.linalg.norm(points[:, None] - points, axis=2) - mean
    pairs = np.clip(base - log_tail(off, V), LEAST, MOST)
    np.fill_diagonal(pairs, SHARED)
    return pairs


def value(scene, bonds, columns):
    """Objective of a decision: the gains of its pairings and the effects of its bonds."""
    total = sum(
        gain
        for row, column, gain in zip(scene["rows"], scene["columns"], scene["gains"], strict=True)
        if columns[row] == column
    )
    for bond in bonds:
        a, b = columns[bond[0]], columns[bond[1]]
        if a >= 0 and b >= 0:
            total += effects(scene, bond)[a, b]
    return total


def best(scene, bonds):
    """The best decision of all, without a detection in two tracks."""
    options = [[-1] for _ in scene["centers"]]
    for row, column in zip(scene["rows"], scene["columns"], strict=True):
        options[row].append(column)
    every = (
        columns
        for columns in itertools.product(*options)
        if len({c for c in columns if c >= 0}) == sum(c >= 0 for c in columns)
    )
    return max(every, key=lambda columns: value(scene, bonds, columns))


def decided(scene, bonds):
    ends = np.array([bond[:2] for bond in bonds], dtype=np.int32).reshape(-1, 2)
    return _engine.decide_jointly(
        **scene,
        ends=ends,
        n=np.array([bond[2] for bond in bonds], dtype=np.int64),
        means=np.array([bond[3] for bond in bonds], dtype=float),
        variances=np.array([bond[4] for bond in bonds], dtype=float),
    )


def made(seed, n_tracks, links, *, spread=0.06, n_frames=100, shape=None):
    """Markers at random, whose predictions err by `spread`, with all detections as candidates."""
    rng = np.random.default_rng(seed)
    at = rng.uniform(0, 0.3, (n_tracks, 3)) if shape is None else shape
    centers = at + rng.normal(0, spread, at.shape)
    points = np.vstack([at + rng.normal(0, 3e-4, at.shape), rng.uniform(0, 0.3, (1, 3))])
    rows, columns = np.divmod(np.arange(n_tracks * len(points)), len(points))
    errors = np.sum((points[columns] - centers[rows]) ** 2, axis=1)
    scene = {
        "centers": centers,
        "track_variances": np.full(n_tracks, spread**2),
        "points": points,
        "rows": rows.astype(np.int32),
        "columns": columns.astype(np.int32),
        "gains": 6 - errors / (2 * spread**2),
    }
    bonds = [(a, b, n_frames, float(np.linalg.norm(at[a] - at[b])), 1e-7) for a, b in links]
    return scene, bonds


def of_two(seed):
    """Two markers with a bond, few detections near both, and gains that are worth little."""
    rng = np.random.default_rng(seed)
    spread = 10 ** rng.uniform(-3, -0.3)
    at = np.array([[0, 0, 0], [rng.uniform(0.02, 0.2), 0, 0]])
    points = np.vstack([at, at[:1]]) + rng.normal(0, spread, (3, 3))
    rows, columns = np.divmod(np.arange(6), 3)
    scene = {
        "centers": at + rng.normal(0, spread, at.shape),
        "track_variances": np.full(2, spread**2) * rng.uniform(0.2, 2, 2),
        "points": points,
        "rows": rows.astype(np.int32),
        "columns": columns.astype(np.int32),
        "gains": rng.uniform(-3, 6, 6),
    }
    distance = float(np.linalg.norm(at[0] - at[1])) + rng.normal(0, spread)
    mean = max(distance, 0.01)
    return scene, [(0, 1, int(rng.integers(40, 900)), mean, rng.uniform(0, 0.03 * mean) ** 2)]


def test_two_markers_are_decided_as_by_enumeration():
    # One bond has no cycle, so that messages are exact.
    same = 0
    for seed in range(400):
        scene, bonds = of_two(seed)
        same += tuple(decided(scene, bonds)) == best(scene, bonds)
    assert same == 400


def effect_of(scene, bond):
    """The effect of a bond, from the gain at which the second of two tracks loses its detection."""
    low, high = -20.0, 20.0
    while high - low > 1e-11:
        gain = (low + high) / 2
        has_place = decided({**scene, "gains": np.array([50.0, gain])}, [bond])[1] == 1
        low, high = (low, gain) if has_place else (gain, high)
    return -low


@pytest.mark.parametrize("error", [0, 1e-4, 1e-3, 3e-3, 0.01, 0.02, 0.03, 0.05, 0.08, 0.3])
def test_the_effect_of_a_bond_is_that_of_the_formula(error):
    # Errors from none to large ones, of distances from precise to vague, beyond both bounds.
    for spread in (1e-4, 1e-3, 0.02, 0.5):
        scene = {
            "centers": np.array([[0, 0, 0], [0.2 + spread, 0, 0]]),
            "track_variances": np.array([spread**2, 2 * spread**2]),
            "points": np.array([[0, 0, 0], [0.2 + error, 0, 0]]),
            "rows": np.arange(2, dtype=np.int32),
            "columns": np.arange(2, dtype=np.int32),
        }
        bond = (0, 1, 300, 0.2, 1e-6)
        assert effect_of(scene, bond) == pytest.approx(effects(scene, bond)[0, 1], abs=1e-9)


@pytest.mark.parametrize("seed", range(40))
def test_a_chain_of_bonds_is_decided_as_by_enumeration(seed):
    # Without cycles messages are exact once they are settled, but for detections in two tracks that
    # have no bond.
    scene, bonds = made(seed, 3, [(0, 1), (1, 2)])
    found, wanted = decided(scene, bonds), best(scene, bonds)
    assert value(scene, bonds, found) >= value(scene, bonds, wanted) - 0.5


def test_cycles_of_bonds_are_decided_nearly_as_by_enumeration():
    pairs = list(itertools.combinations(range(4), 2))
    same = 0
    for seed in range(40):
        scene, bonds = made(seed, 4, pairs)
        same += tuple(decided(scene, bonds)) == best(scene, bonds)
    assert same >= 38


def test_bonds_find_the_markers_that_predictions_exchange():
    right = {True: 0, False: 0}
    for seed in range(40):
        scene, bonds = made(seed, 5, list(itertools.combinations(range(5), 2)), spread=0.1)
        for has_bonds in right:
            found = decided(scene, bonds if has_bonds else [])
            right[has_bonds] += int((found == np.arange(5)).sum())
    assert right[True] >= 195 > 150 > right[False]


def test_two_segments_do_not_disturb_each_other():
    # A bond within each of two segments, and none between them.
    for seed in range(20):
        scene, bonds = made(seed, 4, [(0, 1), (2, 3)])
        assert (
            value(scene, bonds, decided(scene, bonds))
            >= value(scene, bonds, best(scene, bonds)) - 0.5
        )


@pytest.mark.parametrize(("n_frames", "variance"), [(9, 1e-7), (100, 0.03**2)])
def test_a_distance_that_is_new_or_varies_is_no_bond(n_frames, variance):
    for seed in range(10):
        scene, bonds = made(seed, 3, [(0, 1), (1, 2)])
        weak = [(a, b, n_frames, mean, variance) for a, b, _, mean, _ in bonds]
        assert np.array_equal(decided(scene, weak), decided(scene, []))


def test_sparse_input_is_decided():
    scene, bonds = made(0, 3, [(0, 1), (1, 2)])
    none = {**scene, "rows": scene["rows"][:0], "columns": scene["columns"][:0],
            "gains": scene["gains"][:0]}  # fmt: skip
    assert decided(none, bonds).tolist() == [-1, -1, -1]
    one = {**scene, "rows": scene["rows"][:1], "columns": scene["columns"][:1],
           "gains": np.array([1.0])}  # fmt: skip
    assert decided(one, bonds).tolist() == [0, -1, -1]
    unlikely = {**one, "gains": np.array([-1.0])}
    assert decided(unlikely, bonds).tolist() == [-1, -1, -1]
