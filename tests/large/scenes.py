"""What the tests of large scenes share: a model, dense random scenes, tables."""

from __future__ import annotations

import numpy as np

import asterism as am

MODEL = am.TrackingModel(
    motion=am.DWNA(acceleration_sigma=0.012, velocity_sigma=0.05),
    sensor=am.Sensor(noise_sigma=0.005, p_detection=0.93, clutter_density=4.0),
    population=am.Population(birth_density=0.05, p_disappear=1e-3, max_speed=0.35, max_gap=5),
)


def dense(n=150, frames=20, seed=1, density=90.0):
    """A corrupted scene in which markers move about as far as they are apart."""
    scene = am.simulate.dense(n_markers=n, frames=frames, seed=seed, density=density)
    return am.simulate.corrupt(scene, missing=0.05, clutter=0.05, noise=0.005, seed=seed)


def labels_of(detections, **options):
    """Labels of the large tracker, frame by frame."""
    mapper = options.pop("mapper", map)
    tracker = am.large.LargeTracker(model=MODEL, n_axes=detections.n_axes, **options)
    state, labels = tracker.init(), []
    for time, points in detections:
        state, decided = tracker.step(state, time, points, mapper=mapper)
        labels += [frame.labels for frame in decided]
    state, decided = tracker.finish(state, mapper=mapper)
    labels += [frame.labels for frame in decided]
    assert state.frames == ()
    return labels


def rows_of(detections, markers=None):
    """Columns frame, x, y, z of a table."""
    columns = {"frame": detections.frame_of, **dict(zip("xyz", detections.points.T, strict=False))}
    return columns if markers is None else columns | {"marker": np.asarray(markers)}


def write_csv(path, columns):
    names = list(columns)
    rows = zip(*(columns[name].tolist() for name in names), strict=True)
    lines = [",".join(names), *(",".join(map(repr, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path
