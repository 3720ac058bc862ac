"""Runs a command sender on asyncio: sends what is due, and sets the timer for the next time."""

import asyncio
from collections.abc import Callable, Sequence

from lockstep.client.control.clutch import Clutch
from lockstep.client.control.clutches import Clutches
from lockstep.client.control.command_sender import CommandSender
from lockstep.client.control.waiters import Waiters
from lockstep.client.errors import ConsoleLost
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
        self._waiters = Waiters()

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
        self.sender.gate.shown(stamp)
        self.pump()

    def heard(self, microphone: str, stamp: int) -> None:
        """Note that a segment of sound plays, or is too old to."""
        self.sender.gate.heard(microphone, stamp, self._loop.time())
        self.pump()

    def loss(self) -> None:
        """Note that a message of this connection was lost."""
        self.sender.retransmission.loss(self._loop.time())

    async def drive(self, values: Sequence[float | None], speed: float = 1.0) -> Feedback:
        """Send `values` as soon as the gate opens; return the feedback that answers them.

        Raises:
            NotArmed: a neutral command comes first.
            CommandRefused: another try would be refused as well.
            ConsoleLost: the connection ended.
        """
        self._waiters.check()
        answered = self._waiters.answer(self.sender.intend(values, self._loop.time(), speed))
        self.pump()
        return await answered

    async def arm(self) -> Feedback:
        """Send a neutral command; return the feedback that answers it. Raises like `drive`."""
        self._waiters.check()
        answered = self._waiters.answer(self.sender.arm())
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
        self._waiters.check()
        rested = self._waiters.rest()
        self.pump()
        await rested

    def let_go(self) -> None:
        """Rest at once, and do not wait for its proof."""
        self.sender.rest(self._loop.time())
        self._clutches.release()
        self.pump()

    def pump(self) -> None:
        """Send the due messages, hand out outcomes, and set the timer for the next time."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._waiters.lost is not None:
            self._clutches.release()
            return
        now = self._loop.time()
        for message in self.sender.due(now):
            self._clutches.sent(message)
            self._send(message)
        self._clutches.settle()
        while self.sender.sent_at:
            self.picture_delay.sent(*self.sender.sent_at.popleft())
        self._waiters.settle(self.sender.outcomes())
        if not self.sender.resting:
            self._waiters.rested()
        wake_at = self.sender.wake_at(now)
        if wake_at < float("inf"):
            self._timer = self._loop.call_at(wake_at, self.pump)

    def end(self, lost: ConsoleLost) -> None:
        """End every wait: the connection ended."""
        self._waiters.end(lost)
        self.pump()
