"""What a run needs of whoever drives the arm: a headless client, or a page."""

from collections import Counter
from typing import Literal, NamedTuple, Protocol, get_args

from lockstep.bench.pick_place.script import Hand, PickAndPlace
from lockstep.protocol.description import RobotDescription

__all__ = ["PAGE_HANDS", "HandName", "HeadlessHandName", "Operator", "OperatorFailed", "PageHandName", "Pictures"]

HeadlessHandName = Literal["tool", "leader", "policy"]
PageHandName = Literal["pad", "headset"]
HandName = Literal["tool", "leader", "policy", "pad", "headset"]
PAGE_HANDS: tuple[PageHandName, ...] = get_args(PageHandName)


class Pictures(NamedTuple):
    """What was shown of all streams so far."""

    rendered: int
    violations: int  # beyond the tolerance


class Operator(Protocol):
    """Drives the arm.

    Attributes:
        longest: s that one motion may take
        longest_block: s that a block may take
    """

    longest: float
    longest_block: float

    @property
    def description(self) -> RobotDescription: ...

    def hand(self) -> Hand:
        """Return the way in which it commands, new for each block."""

    async def reset_scene(self) -> None:
        """Put blocks and bowl back."""

    async def until_in_bowl(self, count: int) -> None:
        """Wait until the robot says that so many blocks lie in the bowl."""

    async def operate(self, task: PickAndPlace, held_up: Counter[str]) -> None:
        """Drive until the task is done or has failed. `held_up`: counts why the robot had to be armed anew.

        Raises:
            CommandRefused: for another reason than that somebody was held up.
            OperatorFailed: the page does not do what its operator asks for.
            ConsoleLost: the connection ended.
        """

    async def pictures(self) -> Pictures: ...


class OperatorFailed(Exception):
    """A page does not do what its operator asks for."""
