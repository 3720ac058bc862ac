"""Operators of the SO-101 without hands, which put blocks into the bowl."""

from lockstep.bench.pick_place.motions import BLOCKS
from lockstep.bench.pick_place.script import PickAndPlace

__all__ = ["BLOCKS", "PickAndPlace"]
