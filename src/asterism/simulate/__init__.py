"""Simulation: scenes with ground truth, their corruption, and their filming by a rig."""

from asterism.simulate.centroids import Seeing
from asterism.simulate.corruption import corrupt
from asterism.simulate.episodes import Burst, Ghosts, Visits
from asterism.simulate.film import Film, film
from asterism.simulate.lissajous import dense, smooth
from asterism.simulate.people.hand import fingers
from asterism.simulate.people.juggler import juggler
from asterism.simulate.people.pair import two_people
from asterism.simulate.people.person import person
from asterism.simulate.points import attracted, crossing, cube, walk, wander
from asterism.simulate.scenes import SCENES, Scene, from_capture
from asterism.simulate.swarm import swarm
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
    "corrupt",
    "crossing",
    "cube",
    "dense",
    "film",
    "fingers",
    "from_capture",
    "juggler",
    "person",
    "smooth",
    "swarm",
    "two_people",
    "walk",
    "wander",
]
