"""Captures whose truth is known: scenes in motion, and what goes wrong when one is recorded."""

from asterism.simulate.corruption import corrupt
from asterism.simulate.episodes import Burst, Ghosts
from asterism.simulate.film import Film, film
from asterism.simulate.scenes import SCENES, Scene, attracted, crossing, cube, smooth, walk

__all__ = [
    "SCENES",
    "Burst",
    "Film",
    "Ghosts",
    "Scene",
    "attracted",
    "corrupt",
    "crossing",
    "cube",
    "film",
    "smooth",
    "walk",
]
