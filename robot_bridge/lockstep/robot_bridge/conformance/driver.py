"""An operator of the conformance check: answers feedback, moves little, and ends when somebody else stops the robot."""

import asyncio
import contextlib
from collections import deque
from collections.abc import Callable, Sequence
from typing import Protocol

from lockstep.protocol.actions import ActionUpdate
from lockstep.protocol.description import Axis, RobotDescription
from lockstep.protocol.messages import Command, Feedback, Goodbye, LinkMessage, Refusal, Reset, Stop, StopTaken
from lockstep.protocol.neutral import neutral_values
from lockstep.protocol.serial import event_after, is_newer
from lockstep.robot_bridge.conformance.errors import NotApplicable, StoppedByOther, Violation, expect
from lockstep.robot_bridge.conformance.peer import Peer
from lockstep.robot_bridge.conformance.waiting import PATIENCE, within
from lockstep.robot_bridge.control.feedback_fit import misfit

__all__ = ["BY", "Driver", "Motion", "first_motion", "near_goal"]

BY = "lockstep check"  # name for stops and resets
KEPT = 64  # updates of actions
TRIES = 5  # attempts at a command that a bridge on a busy machine refuses because it was held up
MOST_AHEAD = 3  # events by which a bridge may delay feedback, to keep max_event_rate
RESET_AGAIN = 0.1  # s between two tries to reset a stop that is too new


class Motion(Protocol):
    """The motions that the cases may make, and their own STOP presses."""

    presses: set[str]

    def next_values(self, description: RobotDescription, goals: Sequence[float | None]) -> list[float | None]:
        """Return the values of a small motion; the next one goes the other way. `goals`: the applied goals."""

    def next_goal(self, axis: Axis, goal: float) -> float:
        """Return a goal a small way from the applied one; the next one goes the other way."""


class Driver:
    """An operator link, its description, the newest feedback, and the motion that the cases may make."""

    def __init__(self, peer: Peer, description: RobotDescription, motion: Motion) -> None:
        self.peer = peer
        self.description = description
        self.feedback = Feedback(event=1, issue=1, time=0.0, axes=[])  # until the first has come
        self.began: dict[int, float] = {}  # event -> s of the bridge's clock, when it was first measured
        self.passed_over: deque[ActionUpdate] = deque(maxlen=KEPT)  # heard while a stop was pressed, oldest first
        self.motion = motion
        self._next_command = 0.0  # s of the loop's clock: not before that, to keep max_event_rate

    @property
    def neutral(self) -> list[float | None]:
        return neutral_values(self.description.axes)

    def moving(self) -> list[float | None]:
        """Return the values of a small motion.

        Raises:
            NotApplicable: no axis of this robot moves.
        """
        return self.motion.next_values(self.description, self.feedback.goals)

    def command(
        self, values: Sequence[float | None], *, nonce: int | None = None, issue: int | None = None, speed: float = 1.0
    ) -> Command:
        """Return a command for the next event, as an answer to the newest feedback unless told otherwise."""
        newest = self.feedback
        return Command(
            event=event_after(newest.event),
            issue=newest.issue if issue is None else issue,
            values=list(values),
            nonce=newest.nonce if nonce is None else nonce,
            speed=speed,
        )

    async def next(self) -> LinkMessage:
        """Return the next message.

        Raises:
            Violation: the link ended, or a feedback does not fit the description.
        """
        message = await self.peer.next()
        if message is None or isinstance(message, Goodbye):
            raise Violation(f"the operator link ended: {message.error if message else 'without a goodbye'}")
        if isinstance(message, Feedback):
            self._take(message)
        return message

    async def heard(self, condition: Callable[[Feedback], bool], what: str, patience: float = PATIENCE) -> Feedback:
        """Wait until the newest feedback meets the condition, and return it.

        Raises:
            Violation: that took too long.
        """
        async with within(patience, f"no feedback within {patience:g} s says: {what}"):
            while not condition(self.feedback):
                await self.next()
        return self.feedback

    async def fresh(self) -> Feedback:
        """Return the next feedback."""
        before = self.feedback
        return await self.heard(lambda feedback: feedback is not before, "the state, once more")

    async def drive(self, values: Sequence[float | None], speed: float = 1.0) -> Feedback:
        """Send a command and return its feedback; raises as `execute` does."""
        await self.execute(values, speed)
        return self.feedback

    async def execute(self, values: Sequence[float | None], speed: float = 1.0, *, copies: int = 1) -> Command:
        """Send a command until it executes, and return it. Its feedback is the newest then.

        A bridge that was held up first gets the neutral command it needs. `copies` are sent at once.

        Raises:
            Violation: the command was refused.
        """
        loop = asyncio.get_running_loop()
        for _ in range(TRIES):
            await asyncio.sleep(max(0.0, self._next_command - loop.time()))
            self._next_command = loop.time() + 1 / self.description.max_event_rate
            command = self.command(values, speed=speed)
            refusal = await self._executed(command, copies)
            if refusal is None:
                return command
            expect(
                refusal.reason in ("not_neutral", "late"),
                f"a proper command was refused {refusal.reason}: {refusal.detail}",
            )
            await self.fresh()
            if refusal.reason == "not_neutral" and list(values) != self.neutral:
                await self.arm()
        raise Violation(f"a proper command was refused {TRIES} times, not_neutral or late")

    async def arm(self) -> None:
        """Do everything that must come before the first moving command."""
        tries = 0
        while self.feedback.neutral_needed or self.feedback.warning > 0:
            await self.drive(self.neutral)
            tries = 0 if self.feedback.warning > 0 else tries + 1
            expect(tries < TRIES, "a neutral command executed, and neutral_needed stays true")

    async def refused(self, message: Command | Reset, *reasons: str) -> Refusal:
        """Send a message that must be refused.

        Raises:
            Violation: it executed or was accepted, or was refused for another reason.
        """
        self.peer.send(message)
        before = self.feedback.event
        number = message.number if isinstance(message, Reset) else 0
        wanted = message.event if isinstance(message, Command) else 0
        async with within(PATIENCE, f"neither executed nor refused; the message had to be refused {reasons[0]!r}"):
            while True:
                said = await self.next()
                if isinstance(said, Refusal) and said.event in (wanted, 0) and said.stop == number:
                    expect(said.reason in reasons, f"refused {said.reason!r}, not {' or '.join(map(repr, reasons))}")
                    return said
                if isinstance(said, Feedback) and isinstance(message, Command) and is_newer(said.event, before):
                    raise Violation(f"the command executed as event {said.event}; it had to be refused {reasons[0]!r}")
                if isinstance(said, Feedback) and isinstance(message, Reset) and not said.stop.stopped:
                    raise Violation(f"the reset released the stop; it had to be refused {reasons[0]!r}")

    async def stop(self, press: str, peer: Peer | None = None) -> int:
        """Press STOP, on this link or another; return the number of the press. `passed_over` gets what actions say."""
        self.motion.presses.add(press)
        on = peer or self.peer
        on.send(Stop(by=BY, reason="a case of the conformance check", press=press))
        async with within(PATIENCE, "a stop was not answered with stop_taken"):
            while not isinstance(said := await self.next() if on is self.peer else await on.find(StopTaken), StopTaken):
                if isinstance(said, ActionUpdate):
                    self.passed_over.append(said)
        expect(said.press == press, f"stop_taken names the press {said.press!r}, not {press!r}")
        return said.number

    async def reset(self) -> None:
        """Release the newest stop as soon as the bridge accepts that."""
        number = self.feedback.stop.number
        loop = asyncio.get_running_loop()
        deadline = loop.time() + PATIENCE
        while self.feedback.stop.stopped:
            expect(loop.time() < deadline, f"a reset that names the newest stop, {number}, does not release it")
            self.peer.send(Reset(by=BY, number=number))
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(RESET_AGAIN):
                    while self.feedback.stop.stopped:
                        await self.next()

    async def _executed(self, command: Command, copies: int) -> Refusal | None:
        """Send a command. Return its refusal, or None if it executed."""
        self.peer.send(*([command] * copies))
        longest = PATIENCE + MOST_AHEAD / self.description.max_event_rate
        async with within(longest, "a proper command was neither executed nor refused"):
            while self.feedback.event != command.event:
                said = await self.next()
                if isinstance(said, Refusal) and said.event == command.event:
                    return said
                jumped = isinstance(said, Feedback) and is_newer(said.event, command.event)
                expect(not jumped, f"event {command.event} was commanded, and event {self.feedback.event} is current")
        return None

    def _take(self, feedback: Feedback) -> None:
        stop = feedback.stop
        if stop.stopped and (stop.by != BY or stop.press not in self.motion.presses):
            raise StoppedByOther(f"somebody stopped the robot: {stop.by or 'nobody named'}: {stop.reason}")
        if wrong := misfit(feedback, self.description):
            raise Violation(wrong)
        expect(
            not is_newer(self.feedback.event, feedback.event) or not self.feedback.axes,
            f"event {self.feedback.event} was current, and now {feedback.event} is",
        )
        self.feedback = feedback
        if feedback.issue == 1:  # a later one does not tell when the event began
            self.began[feedback.event] = feedback.time


def first_motion(
    description: RobotDescription, goals: Sequence[float | None], fraction: float, direction: int
) -> list[float | None]:
    """Return values with every axis at rest but one, which gets a fraction of its range, or of its reach.

    Raises:
        NotApplicable: no axis moves.
    """
    values = neutral_values(description.axes)
    signal = "" if description.start_warning is None else description.start_warning.axis
    for index, axis in enumerate(description.axes):
        if axis.name == signal or axis.minimum == axis.maximum:
            continue
        if axis.kind == "goal":
            goal = goals[index] if index < len(goals) else None
            if goal is None:
                continue
            values[index] = near_goal(axis, goal, fraction, direction)
        else:
            up, down = axis.maximum - axis.rest, axis.rest - axis.minimum
            upwards = up > 0 if direction > 0 else down <= 0
            values[index] = axis.rest + (fraction * up if upwards else -fraction * down)
        return values
    raise NotApplicable("no axis of this robot moves")


def near_goal(axis: Axis, goal: float, fraction: float, direction: int) -> float:
    """Return a goal that is a fraction of the axis' reach away, the other way if it has no room on this one."""
    way = fraction * axis.reach * direction
    if axis.wrap is None and not axis.minimum <= goal + way <= axis.maximum:
        way = -way
    return goal + way if axis.wrap is not None else min(max(goal + way, axis.minimum), axis.maximum)
