"""Scenes with people: markers on moving bodies that occlude them; seconds, metres, z up."""

from asterism.simulate.people.hand import fingers
from asterism.simulate.people.juggler import juggler
from asterism.simulate.people.pair import two_people
from asterism.simulate.people.person import person

__all__ = ["fingers", "juggler", "person", "two_people"]
