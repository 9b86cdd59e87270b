"""Scenes with people, in real seconds and metres, z up: markers on moving bodies that hide them."""

from asterism.simulate.people.hand import fingers
from asterism.simulate.people.juggler import juggler
from asterism.simulate.people.pair import two_people
from asterism.simulate.people.person import person

__all__ = ["fingers", "juggler", "person", "two_people"]
