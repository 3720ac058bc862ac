"""The bridge that is checked: opens links to it for the cases, and remembers the direction of the last motion."""

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager

from lockstep.protocol.description import Axis, RobotDescription
from lockstep.protocol.errors import LinkRefused
from lockstep.protocol.messages import Feedback, Hello, LinkRole
from lockstep.robot_bridge.conformance.driver import Driver, first_motion, near_goal
from lockstep.robot_bridge.conformance.errors import NotApplicable, NotReady, Violation
from lockstep.robot_bridge.conformance.peer import Peer, opened
from lockstep.robot_bridge.conformance.place import Place
from lockstep.robot_bridge.conformance.waiting import PATIENCE, SETTLE
from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.errors import DescriptionError

__all__ = ["FRACTION", "Subject", "described", "needs"]

FRACTION = 0.1  # share of an axis' limit by which the cases move it
TAKEN_AGAIN = 0.05  # s between two tries while the bridge has not yet seen that the last case left


class Subject:
    """The bridge's place, and the state that the cases share."""

    def __init__(self, place: Place, fraction: float = FRACTION, *, settle: float = SETTLE) -> None:
        """`settle`: s that the robot may take to stand still; more for a simulation that a busy machine holds up."""
        self.place = place
        self.settle = settle
        self.presses: set[str] = set()  # STOP presses of the cases
        self._fraction = fraction
        self._direction = -1  # of the last motion

    def next_values(self, description: RobotDescription, goals: Sequence[float | None]) -> list[float | None]:
        """Return the values of a small motion, each opposite to the last, so that the robot stays where it is."""
        self._direction = -self._direction
        return first_motion(description, goals, self._fraction, self._direction)

    def next_goal(self, axis: Axis, goal: float) -> float:
        """Return a goal a small way from the applied one, each opposite to the last."""
        self._direction = -self._direction
        return near_goal(axis, goal, self._fraction, self._direction)

    @asynccontextmanager
    async def stranger(self) -> AsyncIterator[Peer]:
        """Open a connection on which no message was sent yet."""
        async with opened(self.place) as peer:
            yield peer

    @asynccontextmanager
    async def link(self, role: LinkRole) -> AsyncIterator[tuple[Peer, Hello]]:
        """Open a link with the handshake done.

        Raises:
            LinkRefused: the bridge said goodbye.
        """
        async with opened(self.place) as peer:
            yield peer, await peer.hello(role, self.place.secret)

    @asynccontextmanager
    async def operator(self, *, armed: bool = True) -> AsyncIterator[Driver]:
        """Open an operator link. `armed`: execute the neutral command that must come before the first motion."""
        async with self._operator() as (peer, hello):
            driver = Driver(peer, described(hello), self)
            await driver.heard(lambda feedback: bool(feedback.axes), "the first state")
            if armed and not driver.feedback.stop.stopped:
                await driver.arm()
            yield driver

    async def first_look(self) -> Feedback:
        """Return the robot's feedback before anything is tried.

        Raises:
            NotReady: the robot is stopped, locked or taken, which is not the check's to change.
            LinkLost: no process listens there.
        """
        try:
            async with self._operator() as (peer, _):
                feedback = await peer.find(Feedback)
        except LinkRefused as error:
            raise NotReady(f"the bridge refuses an operator link: {error.detail}") from error
        if feedback.stop.locked_out:
            raise NotReady(f"the robot is locked: {feedback.stop.locked_out}")
        if feedback.stop.stopped:
            raise NotReady(f"the robot is stopped by {feedback.stop.by!r} ({feedback.stop.reason}): reset it first")
        return feedback

    async def clean_up(self) -> None:
        """Bring the robot to rest after a case, and release it if the case stopped it."""
        async with self.operator(armed=False) as driver:
            if driver.feedback.stop.stopped:
                await driver.reset()
            await driver.heard(lambda feedback: feedback.at_rest, "at rest after the case")
        self.presses.discard("")  # from now on, a press without an id is another client's again

    @asynccontextmanager
    async def _operator(self) -> AsyncIterator[tuple[Peer, Hello]]:
        """Open an operator link. Repeat while it is `taken`: the last case's operator may only just have left."""
        deadline = asyncio.get_running_loop().time() + PATIENCE
        while True:
            async with opened(self.place) as peer:
                try:
                    hello = await peer.hello("operator", self.place.secret)
                except LinkRefused as error:
                    if not error.detail.startswith("taken") or asyncio.get_running_loop().time() > deadline:
                        raise
                else:
                    yield peer, hello
                    return
            await asyncio.sleep(TAKEN_AGAIN)


def described(hello: Hello) -> RobotDescription:
    """Return the bridge's description.

    Raises:
        Violation: there is no description, or it makes no sense.
    """
    if hello.description is None:
        raise Violation("the bridge sent no description")
    try:
        check_description(hello.description)
    except DescriptionError as error:
        raise Violation(f"the description makes no sense: {error.detail}") from error
    return hello.description


def needs(condition: bool, what: str) -> None:
    """Require something of the robot that a case needs.

    Raises:
        NotApplicable: this robot does not have it.
    """
    if not condition:
        raise NotApplicable(what)
