"""Asterism: optical motion-capture tracking.

Detections in, tracks out: every method searches the posterior of one generative model and states
how certain each link is. The names here are for everyday use; the rest is in the namespaces
`camera`, `edit`, `filter`, `io`, `large`, `live`, `metrics`, `model`, `multiview`, `plot`,
`simulate`, `solve` and `tracking`.

>>> import asterism as am
>>> capture = am.read("trial.c3d")                        # doctest: +SKIP
>>> tracks = am.track(capture)                            # doctest: +SKIP
>>> am.write(tracks, "trial.tracked.c3d")                 # doctest: +SKIP
"""

import lazy_loader as _lazy

__version__ = "0.1.0"

# The stub is the one list of names. Nothing is imported before its first use, so that
# `import asterism` and `asterism --help` are instant.
__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
