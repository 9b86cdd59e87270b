"""Reconstruction: estimate the image model, then match and triangulate image points."""

from __future__ import annotations

from typing import TYPE_CHECKING

from asterism.multiview.correspondence import match_views
from asterism.multiview.image_estimation import estimate_images

if TYPE_CHECKING:
    from collections.abc import Callable

    from asterism.camera import Observations, Rig
    from asterism.model import Detections
    from asterism.multiview.image_model import ImageModel
    from asterism.multiview.reconstruction import Reconstruction

__all__ = ["reconstruct"]


def reconstruct(
    observations: Observations,
    rig: Rig,
    model: ImageModel | None = None,
    *,
    min_views: int = 2,
    gate: float = 4.0,
    merge_px: float = 1.0,
    prior: Detections | None = None,
    max_nodes: int = 2000,
    n_threads: int = 1,
    advance: Callable[[int], None] | None = None,
) -> Reconstruction:
    """Reconstruct points in space from unnamed image points of several cameras.

    A candidate is a set of image points of different cameras. Its score is the log likelihood that
    one point in space made them, with the position integrated out, relative to clutter; a camera
    that could see the position and has no image point costs a missed detection. Pairs of rays that
    meet are the seeds of candidates. Among the candidates that are more likely than clutter, the
    most likely subset without a common image point is chosen by S-dimensional assignment [1],
    exactly unless ``info["n_cut"]`` is above 0. Each point is triangulated from its measured pixels
    (`triangulate`).

    Parameters
    ----------
    observations : Observations
        Image points of all cameras.
    rig : Rig
        Calibrated cameras, matched to the observations by name. Cameras of the rig without any
        observations are not used.
    model : ImageModel, optional
        Noise, missed detections and clutter of the images. By default it is estimated
        (`estimate_images`).
    min_views : int
        Smallest number of cameras of a point, 2 or more. Larger values make fewer false points and
        lose points that few cameras see.
    gate : float
        Largest distance between an image point and a projected position, standard deviations, > 0.
        Larger values make more candidates and need more time.
    merge_px : float
        Standard deviation of the distance between a merged image point and the images of its two
        points, pixels, ≥ 0. A point outside the chosen subset may then share image points with
        others, but needs one of its own; a shared image point has a lower weight. 0 excludes
        sharing.
    prior : Detections, optional
        Expected 3-D positions with covariances for each frame of the observations, as predicted by
        a tracker (`expected_positions`). A point at an expected position is more likely: it needs
        fewer cameras and is preferred to a ghost. It still needs image points.
    max_nodes : int
        Largest number of search nodes in a group of candidates that share image points, ≥ 1.
        Larger values give exact results in larger groups and need more time.
    n_threads : int
        Number of frames that are processed at the same time, 1 to 1024; the result does not depend
        on it.
    advance : callable, optional
        Called from time to time with the number of finished frames.

    Returns
    -------
    Reconstruction
        Points in space, with the image points and the score of each.

    Raises
    ------
    ParameterError
        If a camera is not in the rig, there are fewer than two cameras, or the prior has other
        frames.

    References
    ----------
    1. S. Deb, M. Yeddanapudi, K. Pattipati, Y. Bar-Shalom: A generalized S-D assignment
       algorithm for multisensor-multitarget state estimation. IEEE Transactions on Aerospace and
       Electronic Systems 33, 1997.

    Examples
    --------
    >>> import asterism as am
    >>> rig = am.Rig.ring(4, radius=3, height=2, target=(0, 0, 0))
    >>> scene = am.simulate.cube(seed=1, frames=10)
    >>> am.reconstruct(am.simulate.film(scene, rig).observations, rig).detections
    Detections(10 frames, 80 points, 3-D, 0 to 9 s)
    """
    if model is None:
        model = estimate_images(observations, rig, gate=gate)
    return match_views(
        observations,
        rig,
        model,
        min_views=min_views,
        gate=gate,
        merge_px=merge_px,
        prior=prior,
        max_nodes=max_nodes,
        n_threads=n_threads,
        advance=advance,
    )
