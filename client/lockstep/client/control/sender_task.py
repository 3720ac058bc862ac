"""Runs a command sender on asyncio: its timer, and the futures of callers that wait for feedback."""

import asyncio
from collections.abc import Callable, Sequence
from typing import Any

from lockstep.client.control.clutch import Clutch
from lockstep.client.control.clutches import Clutches
from lockstep.client.control.command_sender import CommandSender
from lockstep.client.errors import CommandRefused, ConsoleLost, NotArmed
from lockstep.client.statistics import PictureDelay
from lockstep.protocol.messages import Command, Feedback, Refusal, RefusalReason, Rest

__all__ = ["Driver"]


class Driver:
    """Sends the commands and rests of a `CommandSender`, at once and at the right times."""

    def __init__(
        self, sender: CommandSender, send: Callable[[Command | Rest], None], max_event_age: float = 2.0
    ) -> None:
        self.sender = sender
        self._clutches = Clutches(sender, max_event_age)
        self.picture_delay = PictureDelay()
        self._send = send
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._waiting: list[tuple[int, asyncio.Future[Feedback]]] = []
        self._rested: list[asyncio.Future[None]] = []
        self._lost: ConsoleLost | None = None

    def feedback(self, feedback: Feedback) -> bool:
        """Take a feedback; return True if it is newer than all before it."""
        now = self._loop.time()
        newer = self.sender.feedback(feedback, now)
        if newer:
            self._clutches.feedback(feedback, now)
        self.pump()
        return newer

    def watch(self, clutch: Clutch) -> None:
        """Show the clutch each feedback from now on, and release it when it has to be engaged anew."""
        self._clutches.add(clutch, self._loop.time())

    def refusal(self, refusal: Refusal) -> None:
        self.sender.refusal(refusal)
        self.pump()

    def shown(self, stamp: int) -> None:
        """Note that a picture of the main camera is on screen."""
        self.picture_delay.shown(stamp, self._loop.time())
        self.sender.shown(stamp)
        self.pump()

    def heard(self, microphone: str, stamp: int) -> None:
        """Note that a segment of sound plays, or is too old to."""
        self.sender.heard(microphone, stamp, self._loop.time())
        self.pump()

    def loss(self) -> None:
        """Note that a message of this connection was lost."""
        self.sender.loss(self._loop.time())

    async def drive(self, values: Sequence[float | None], speed: float = 1.0) -> Feedback:
        """Send `values` as soon as the gate opens; return the feedback that answers them.

        Raises:
            NotArmed: a neutral command comes first.
            CommandRefused: another try would be refused as well.
            ConsoleLost: the connection ended.
        """
        answered: asyncio.Future[Feedback] = self._future()
        self._waiting.append((self.sender.intend(values, self._loop.time(), speed), answered))
        self.pump()
        return await answered

    async def arm(self) -> Feedback:
        """Send a neutral command; return the feedback that answers it. Raises like `drive`."""
        answered: asyncio.Future[Feedback] = self._future()
        self._waiting.append((self.sender.arm(), answered))
        self.pump()
        return await answered

    def hold_back(self, reason: RefusalReason) -> None:
        """Keep the robot from moving until the program arms again."""
        self.sender.hold_back(reason)
        self.pump()

    async def rest(self) -> None:
        """Rest at once; return when the robot is proven to be at rest. Raises ConsoleLost."""
        self.sender.rest(self._loop.time())
        self._clutches.release()
        rested: asyncio.Future[None] = self._future()
        self._rested.append(rested)
        self.pump()
        await rested

    def let_go(self) -> None:
        """Rest at once, and do not wait for its proof."""
        self.sender.rest(self._loop.time())
        self._clutches.release()
        self.pump()

    def _future(self) -> "asyncio.Future[Any]":
        if self._lost is not None:
            raise self._lost
        return self._loop.create_future()

    def pump(self) -> None:
        """Send the due messages, hand out outcomes, and set the timer for the next time."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._lost is not None:
            self._clutches.release()
            return
        now = self._loop.time()
        for message in self.sender.due(now):
            self._clutches.sent(message)
            self._send(message)
        self._clutches.settle()
        while self.sender.sent_at:
            self.picture_delay.sent(*self.sender.sent_at.popleft())
        self._hand_out()
        wake_at = self.sender.wake_at(now)
        if wake_at < float("inf"):
            self._timer = self._loop.call_at(wake_at, self.pump)

    def _hand_out(self) -> None:
        for outcome in self.sender.outcomes():
            while self._waiting and self._waiting[0][0] <= outcome.ticket:
                _, waiting = self._waiting.pop(0)
                if waiting.done():
                    continue
                if outcome.feedback is not None:
                    waiting.set_result(outcome.feedback)
                elif outcome.refusal is not None:
                    waiting.set_exception(_error(outcome.refusal))
        if not self.sender.resting:
            for rested in self._rested:
                if not rested.done():
                    rested.set_result(None)
            self._rested.clear()

    def end(self, lost: ConsoleLost) -> None:
        """End every wait: the connection ended."""
        self._lost = lost
        self.pump()
        pending: list[asyncio.Future[Any]] = [*(future for _, future in self._waiting), *self._rested]
        self._waiting.clear()
        self._rested.clear()
        for future in pending:
            if not future.done():
                future.set_exception(lost)


def _error(refusal: Refusal) -> CommandRefused:
    return NotArmed() if refusal.reason == "not_neutral" else CommandRefused(refusal.reason, refusal.detail)
