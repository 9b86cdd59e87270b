"""Distances that tracks keep, and the comparison of a part of a track with them."""

from __future__ import annotations

import numpy as np

SAMPLES, REFERENCES, PART_FRAMES, NEIGHBOURS = 160, 128, 8, 6
MIN_FRAMES, MIN_NEIGHBOURS, ALTERNATIVES = 6, 2, 3
MIN_NOISE, BEND, STEADY, UNKNOWN_SPREAD = 1e-3, 0.02, 0.1, 0.1
SAME, MAX_PRESENT = -0.5, 0.2
MOST, OF_MOST = 0.8, 0.7803


def compare_part(positions, noise, track, frames, partners):
    """Compare one part of a track with every profile.

    The positions have shape (T, K, D), NaN where a track has no detection.

    Returns whether the distances are known, the log density of an unknown marker, the same by
    ranges, and up to three (log density, track), all relative to the own track.
    """
    n_tracks = positions.shape[1]
    is_present = np.isfinite(positions[:, :, 0])
    references, samples = references_of(positions), samples_of(positions)

    def profile(k):
        return profile_of(positions, noise, k)

    n = min(len(frames), PART_FRAMES)
    used = [frames[i * (len(frames) - 1) // (n - 1)] if n > 1 else frames[0] for i in range(n)]
    own = profile(track)
    distances = {}
    for r in own:
        both = [t for t in used if is_present[t, r]]
        if both:
            values = np.linalg.norm(positions[both, track] - positions[both, r], axis=1)
            distances[r] = _upper_median(values)
    order = {r: i for i, r in enumerate(references)}
    steady = sorted((own[r][1], order[r], r) for r in distances if own[r][1] < STEADY)
    steady = [r for _, _, r in steady[:NEIGHBOURS]]
    if len(steady) < MIN_NEIGHBOURS:
        return False, 0.0, 0.0, []
    off = {r: distances[r] - own[r][0] for r in distances}
    unknown = np.mean(
        [
            _log_t(off[r], np.hypot(own[r][1], UNKNOWN_SPREAD)) - _log_t(off[r], own[r][1])
            for r in steady
        ]
    )
    ranges = sorted((own[r][2], order[r], r) for r in distances if own[r][1] < STEADY)
    of_own, apart = np.array([(s, off[r]) for s, _, r in ranges[:NEIGHBOURS]]).T
    of_unknown = np.hypot(of_own, UNKNOWN_SPREAD)
    in_range = np.average(
        _log_t(apart, of_unknown) - _log_t(apart, of_own), weights=np.log(of_unknown / of_own)
    )
    others = []
    for k in range(n_tracks):
        n_present = sum(is_present[t, k] for t in used)
        if k == track or (k not in partners and n_present > MAX_PRESENT * n):
            continue
        other = profile(k)
        common = [r for r in steady if r in other]
        if len(common) < MIN_NEIGHBOURS:
            continue
        if not (is_present[samples, k] & is_present[samples, track]).any():
            same = 0.0
            for r in common:
                spread = np.hypot(own[r][1], other[r][1])
                same += _log_t(own[r][0] - other[r][0], spread) - _log_t(0.0, spread)
            if same > SAME * len(common):
                continue  # the track may be of the same marker
        density = np.mean(
            [
                _log_t(distances[r] - other[r][0], other[r][1]) - _log_t(off[r], own[r][1])
                for r in common
            ]
        )
        others.append((float(density), k))
    best = sorted(others, key=lambda one: (-one[0], one[1]))[:ALTERNATIVES]
    return True, float(unknown), float(in_range), best


def references_of(positions):
    """Return the longest tracks, to which distances are taken."""
    lengths = np.isfinite(positions[:, :, 0]).sum(axis=0)
    return sorted(range(len(lengths)), key=lambda k: (-lengths[k], k))[:REFERENCES]


def samples_of(positions):
    """Return the frames from which profiles are learnt."""
    n = min(SAMPLES, len(positions))
    return [s * len(positions) // n for s in range(n)]


def profile_of(positions, noise, k):
    """Return median, spread and range of the distance of a track to each reference that has one."""
    found, is_present = {}, np.isfinite(positions[:, :, 0])
    for r in references_of(positions):
        both = [t for t in samples_of(positions) if is_present[t, k] and is_present[t, r]]
        if r == k or len(both) < MIN_FRAMES:
            continue
        values = np.linalg.norm(positions[both, k] - positions[both, r], axis=1)
        median = _upper_median(values)
        off = np.sort(abs(values - median))
        spread, most = 1.4826 * _upper_median(off), OF_MOST * off[int(MOST * (len(off) - 1))]
        floor = 2 * max(noise, MIN_NOISE) ** 2 + (BEND * median) ** 2
        found[r] = median, np.sqrt(spread**2 + floor), np.sqrt(most**2 + floor)
    return found


def log_ratio_to_unknown(distances, profile):
    """Return the log density of distances by a profile, relative to an unknown marker.

    It is the mean over the steadiest ones, None where there are too few.
    """
    steady = sorted((s, i, r) for i, (r, (_, s, _)) in enumerate(profile.items()) if s < STEADY)
    used = [r for _, _, r in steady if r in distances][:NEIGHBOURS]
    if len(used) < MIN_NEIGHBOURS:
        return None
    off = {r: distances[r] - profile[r][0] for r in used}
    return np.mean(
        [
            _log_t(off[r], profile[r][1]) - _log_t(off[r], np.hypot(profile[r][1], UNKNOWN_SPREAD))
            for r in used
        ]
    )


def _upper_median(values):
    return np.sort(values)[len(values) // 2]


def _log_t(off, spread):
    return -2 * np.log1p(off**2 / (3 * spread**2)) - np.log(spread)
