"""The clutches of a connection: shows them feedback, and releases those that have to be engaged anew. No I/O."""

from weakref import WeakSet

from lockstep.client.control.clutch import Clutch
from lockstep.client.control.command_sender import CommandSender
from lockstep.protocol.messages import Command, Feedback, Rest

__all__ = ["Clutches"]


class Clutches:
    """Call `feedback` after the sender took a newer feedback, `sent` with all that leaves, and then `settle`.

    A clutch is released when a neutral command or a rest leaves, when the robot may not move before another neutral
    command (a lost seat or link, a stop, a refusal), and when no feedback came for `max_event_age` (s).
    """

    def __init__(self, sender: CommandSender, max_event_age: float) -> None:
        self._sender = sender
        self._max_event_age = max_event_age
        self._clutches: WeakSet[Clutch] = WeakSet()
        self._heard_at = float("-inf")  # arrival of the newest feedback

    def add(self, clutch: Clutch, now: float) -> None:
        """Show the clutch the newest feedback, unless it is old, and each later one."""
        self._clutches.add(clutch)
        if self._sender.newest is not None and now - self._heard_at <= self._max_event_age:
            clutch.observe(self._sender.newest)

    def feedback(self, feedback: Feedback, now: float) -> None:
        """Show a feedback. After a gap, the goal that waits for it in the sender is void, and a rest is sent."""
        if now - self._heard_at > self._max_event_age:
            if any(clutch.engaged for clutch in self._clutches):
                self._sender.rest(now)
            for clutch in self._clutches:
                clutch.lost_feedback()
        self._heard_at = now
        if self._clutches:  # few programs have any, and the caller waits for this
            for clutch in self._clutches:
                clutch.observe(feedback)

    def sent(self, message: Command | Rest) -> None:
        """Take a message that leaves."""
        if isinstance(message, Rest) or self._sender.intention.moves_nothing(message):
            self.release()

    def settle(self) -> None:
        """Release all unless the robot may move."""
        if not self._sender.readiness.ready:
            self.release()

    def release(self) -> None:
        """Release all."""
        for clutch in self._clutches:
            clutch.release()
