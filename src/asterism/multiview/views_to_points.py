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

    A set of image points of different cameras is weighed by the likelihood that one point made
    them, its place integrated out, against that of their being clutter; a camera that could see
    the place and did not costs a miss. Pairs of rays that meet are the seeds of such sets. Of all
    sets that are likelier than clutter those are chosen that together are the likeliest and share
    no image point: S-dimensional assignment [1]_, exact but for what `info` says. Each is
    triangulated on the pixels as they were measured (`triangulate`).

    Parameters
    ----------
    observations : Observations
        What the cameras saw.
    rig : Rig
        The cameras, found by their names. Those that observed nothing at all, in a rig of more,
        are not asked.
    model : ImageModel, optional
        What the images are like. By default it is estimated (`estimate_images`).
    min_views : int
        Fewest cameras that a point needs, 2 or more.
    gate : float
        Standard deviations within which an image point may be of a place.
    merge_px : float
        How far the middle of two merged images may be from where each belongs, one standard
        deviation, pixels. A point that the choice left may share image points that are taken, but
        needs one of its own; what two points share counts so much less in both. 0 for no sharing.
    prior : Detections, optional
        3-D places where points are expected, with covariances, for each frame of the observations:
        predicted by a tracker (`expected_positions`). A point is likelier there, to be found
        in fewer cameras and preferred to a ghost; what no camera saw is not claimed.
    max_nodes : int
        Most nodes of the search for the best choice in a group of sets that share image points.
    n_threads : int
        Frames at a time; the result does not depend on it.
    advance : callable, optional
        Told the number of frames that are done.

    Returns
    -------
    Reconstruction

    Raises
    ------
    ParameterError
        If a camera is not in the rig, there are under two, or the prior is of other frames.

    References
    ----------
    .. [1] S. Deb, M. Yeddanapudi, K. Pattipati, Y. Bar-Shalom: A generalized S-D assignment
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
