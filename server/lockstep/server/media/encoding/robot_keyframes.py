"""Asks a robot bridge that encodes a camera for keyframes, and decides whether it does as it is asked."""

from collections.abc import Callable

from lockstep.server.media.encoding.stream_encodings import StreamEncodings
from lockstep.server.media.encoding.tier_encoding import TierEncoding
from lockstep.server.media.subscription import Subscription

__all__ = ["RobotKeyframes"]

ANSWER_SECONDS = 3.0  # for a keyframe that was asked for; without it the camera counts as one that takes no requests
DISTRUST_SECONDS = 30.0  # for which it then counts so


class RobotKeyframes:
    """The keyframes of one camera. Sets `StreamEncodings.follows`; call everything on the loop."""

    def __init__(self, encodings: StreamEncodings, passed: TierEncoding) -> None:
        """`passed`: the camera's own encoding."""
        self._encodings = encodings
        self._passed = passed
        self._ask: Callable[[float], None] = lambda now: None
        self._asked_at: float | None = None  # when a keyframe was asked for that has not come; None: none is owed
        self._does = False  # the robot's bridge says that it does as it is asked to
        self._distrusted_until = 0.0
        self._waiting: frozenset[Subscription] = frozenset()  # targets of the console's encodings, at the last look
        self._operators: frozenset[Subscription] = frozenset()  # those of them who drove

    def ask_by(self, ask: Callable[[float], None]) -> None:
        """Set how the robot is asked for a keyframe; called with the time."""
        self._ask = ask

    def follow(self, does: bool, now: float) -> None:
        """Set whether the robot's bridge encodes this camera as it is asked to."""
        self._does = does
        self._decide(now)

    def came(self, now: float) -> None:
        """Note a keyframe of the camera, after `StreamEncodings.passes` was set."""
        self._decide(now)
        self._asked_at = None
        self._passed.keyframes.served(now)

    def serve(self, now: float) -> None:
        """Ask the robot for a keyframe if somebody needs one, unless one is on its way."""
        if not self._encodings.follows:
            return
        if self._asked_at is not None:
            if now - self._asked_at > ANSWER_SECONDS:
                self._distrusted_until = now + DISTRUST_SECONDS
                self._decide(now)
            return
        # A keyframe moves those here that can take it; for the others the console then has few pictures to decode.
        waiting = frozenset(
            target for encoding in self._encodings.own for target in (*encoding.targets, *encoding.arriving)
        )
        if new := waiting - self._waiting:
            self._passed.keyframes.join(other=all(map(self._encodings.is_other, new)))
        operators = frozenset(target for target in waiting if target.priority)
        if operators - self._operators:
            self._passed.keyframes.join()
        self._waiting, self._operators = waiting, operators
        if self._passed.keyframes.take(now):
            self._asked_at = now
            self._ask(now)

    def _decide(self, now: float) -> None:
        follows = self._does and self._encodings.passes and now >= self._distrusted_until
        if follows == self._encodings.follows:
            return
        self._encodings.follows = follows
        self._asked_at = None
        if not follows:
            self._waiting = self._operators = frozenset()
