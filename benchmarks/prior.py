"""Points again where tracks expect them: people before few and many cameras, pass by pass.

Each pass is `am.reconstruct`, then `am.estimate_model`, then SMP over three frames, whose
predictions are what the next pass expects. Prints Markdown.

    python benchmarks/prior.py [--frames N] [--seed N] [--markdown FILE]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import asterism as am
from asterism.cli.commands.reconstruct import true_tracks
from asterism.simulate.rig_presets import place_preset
from reconstruction import REAL
from report import conditions, publish, table

PASSES = 3
SCENES = (
    ("person", "walk", "ring4"),
    ("person", "walk", "ring6"),
    ("person", "jump", "ring8"),
    ("two_people", "hug", "ring12"),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    rows: list[list[str]] = []
    for scene, activity, preset in SCENES:
        make = am.simulate.SCENES[scene].make
        truth = make(frames=options.frames, seed=options.seed, activity=activity)
        X = truth.detections.points
        rig, _ = place_preset(preset, X.min(axis=0), X.max(axis=0))
        shot = am.simulate.film(truth, rig, seeing=REAL, seed=options.seed)
        seen = (shot.blob_of >= 0).sum(axis=0) >= 2
        prior: am.Detections | None = None
        for n in range(PASSES):
            made = am.reconstruct(shot.observations, rig, prior=prior)
            s = am.metrics.point_scores(made.detections, truth, counted=seen, radius=0.02)
            model = am.estimate_model(made.detections).model
            tracks = am.track(made.detections, am.SMP(window=3), model=model)
            e = am.evaluate(tracks, true_tracks(made, shot.observations))
            rows.append(
                [
                    f"{scene}, {activity}, {preset}",
                    str(n + 1),
                    f"{100 * s.recall:.2f}",
                    f"{100 * s.ghosts:.2f}",
                    f"{e.idf1:.4f}",
                    str(e.switches),
                ]
            )
            print(*rows[-1], flush=True)
            prior = am.filter.expected_positions(tracks, model)
    head = ["scene", "pass", "found, %", "ghosts, %", "SMP window 3, IDF1", "switches"]
    publish([*table(head, rows), "", conditions()], options.markdown)


if __name__ == "__main__":
    main()
