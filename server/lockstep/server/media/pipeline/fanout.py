"""The last stage sends frames to targets: the operator's at once, observers' in their turns of the event loop.

An exception while serving a target concerns that target alone: it is told and gets nothing more; all others are served.
"""

from collections import deque
from collections.abc import Iterable
from typing import Protocol

from lockstep.server.media.encoding.tier_encoding import TierEncoding
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.media.pipeline.stage import FrameStage, SourceFrame
from lockstep.server.util.cooperative_scheduler import CooperativeScheduler

__all__ = ["FanOut", "Target"]


class Target(Protocol):
    """One stream of one peer."""

    @property
    def priority(self) -> bool:
        """True if it belongs to the operator."""

    def put(self, frame: EncodedFrame) -> None:
        """Queue a frame; never blocks."""

    def send_next(self) -> bool:
        """Send one queued frame if there is one and the socket takes it; True if another can follow."""

    def failed(self, error: Exception) -> None:
        """Take the error that serving this target raised. It is not served again. Raises nothing."""


class FanOut(FrameStage):
    """Ends all chains. A slow target fills only its own queue; an observer never delays the operator."""

    def __init__(self, turns: CooperativeScheduler) -> None:
        self._turns = turns
        self._waiting: dict[Target, None] = {}  # observers with frames, in the order they are served
        self._order: deque[Target] = deque()
        self._asked = False  # for a turn of the loop

    def source(self, frame: SourceFrame) -> None:
        pass  # a stage before has encoded it, or dropped it

    def encoded(self, frame: EncodedFrame, encoding: TierEncoding) -> None:
        encoding.publishing(frame)
        self.publish(frame, encoding.targets)

    def publish(self, frame: EncodedFrame, targets: Iterable[Target]) -> None:
        """Hand a frame to its targets. Returns when the operator's is sent and the others are queued."""
        observers = []
        for target in list(targets):  # a target that fails is removed from them
            if target.priority:
                if self._put(target, frame):
                    self._send_all(target)
            else:
                observers.append(target)
        for target in observers:
            if self._put(target, frame):
                self._enqueue(target)

    def _put(self, target: Target, frame: EncodedFrame) -> bool:
        try:
            target.put(frame)
        except Exception as error:
            self._failed(target, error)
            return False
        return True

    def _failed(self, target: Target, error: Exception) -> None:
        self.forget(target)
        target.failed(error)

    def serve_again(self, target: Target) -> None:
        """Serve a target whose pacer has sent all packets that it held back."""
        if target.priority:
            self._send_all(target)
        else:
            self._enqueue(target)

    def _send_all(self, target: Target) -> None:
        try:
            while target.send_next():
                pass
        except Exception as error:
            self._failed(target, error)

    def _enqueue(self, target: Target) -> None:
        if target not in self._waiting:
            self._waiting[target] = None
            self._order.append(target)
        self._ask()

    def forget(self, target: Target) -> None:
        """Remove a target. Idempotent."""
        if target in self._waiting:
            del self._waiting[target]
            self._order = deque(each for each in self._order if each is not target)

    def _ask(self) -> None:
        if self._order and not self._asked:
            self._asked = True
            self._turns.ask(self._take_turn)

    def _take_turn(self) -> None:
        self._asked = False
        try:
            self.serve()
        finally:
            self._ask()

    def serve(self) -> None:
        """Serve observers in turn, one frame each, until the slice is over."""
        while self._order:
            self._serve_one(self._order.popleft())
            if self._turns.is_over():
                return

    def _serve_one(self, target: Target) -> None:
        try:
            if target.send_next() and target in self._waiting:
                self._order.append(target)
                return
        except Exception as error:
            self._failed(target, error)
        self._waiting.pop(target, None)
