"""Captures whose truth is known: scenes in motion, and what goes wrong when one is recorded."""

from asterism.simulate.episodes import Burst, Ghosts, Visits
from asterism.simulate.film import Film, film
from asterism.simulate.scenes import SCENES, Scene, attracted, crossing, cube, smooth, walk
from asterism.simulate.seeing import Seeing
from asterism.simulate.sensing import sense
from asterism.simulate.truth import Truth

__all__ = [
    "SCENES",
    "Burst",
    "Film",
    "Ghosts",
    "Scene",
    "Seeing",
    "Truth",
    "Visits",
    "attracted",
    "crossing",
    "cube",
    "film",
    "sense",
    "smooth",
    "walk",
]
