"""The model of a crowd that crosses itself."""

from __future__ import annotations

import asterism as am
from tests.scenes import small_model


def crowd_model():
    return small_model(
        p_redetection=None,
        motion=am.DWNA(acceleration_sigma=1.2, velocity_sigma=0.3), noise_sigma=0.01,
        max_speed=1.5, clutter_density=5.0, birth_density=0.5, p_disappear=1e-3, max_gap=6,
    )  # fmt: skip
