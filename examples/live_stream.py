"""Points as they come, identities as they go: frame by frame, with revisions.

A new marker gets its identity when it is confirmed, a few frames after it came; `revised` then says
which of the earlier detections were its own.
"""

from __future__ import annotations

import asterism as am


def main() -> None:
    scene = am.simulate.cube(seed=1, rate=100)
    capture = am.simulate.corrupt(scene, missing=0.1, clutter=0.1, noise=0.001, seed=2).detections
    model = am.estimate_model(capture).model  # of an earlier take, say

    method = am.GNN()
    state, tracks = method.init(model), None
    for time, points in capture:
        state, update = method.step(state, time, points)
        if len(update.revised):
            print(f"{time:.2f} s: {len(update.revised)} earlier detections got their names")
        tracks = update.tracks
    assert tracks is not None  # every method of Asterism reports them
    for identity, gap, place in zip(tracks.ids, tracks.gaps, tracks.positions, strict=True):
        x, y, z = place
        occluded = f", not seen for {gap} frames" if gap else ""
        print(f"marker {identity} at ({x:.3f}, {y:.3f}, {z:.3f}) m{occluded}")


if __name__ == "__main__":
    main()
