"""Which of a stream's encodings is recorded. Nothing is encoded twice for it where somebody already takes it."""

from collections.abc import Mapping
from typing import Protocol

from robot_bridge.protocol.console import Tier
from server.media.frame import EncodedFrame
from server.media.output import Output
from server.media.quality.plan import PicturePlan

__all__ = ["FrameTaker", "RecordedOutput", "RecordedStream"]

TIERS: tuple[Tier, ...] = ("operator", "high", "low")


class FrameTaker(Protocol):
    """The recorder. Called on the loop, returns at once."""

    def __call__(self, stream: str, codec: str, frame: EncodedFrame, *, attached: bool) -> None: ...


class RecordedStream(Protocol):
    """What it needs of the stream."""

    @property
    def name(self) -> str: ...
    @property
    def full_plan(self) -> PicturePlan: ...
    @property
    def outputs(self) -> Mapping[tuple[str, Tier], Output]: ...
    def output(self, codec: str, tier: Tier) -> Output: ...


class RecordedOutput:
    """Call `choose` before each medium, `published` with each frame, `close` at the end.

    The operator's encoding comes first; else that of observers; else one is made. Another one is taken from its next
    keyframe on.

    Args:
        codec: in which it is recorded
        own_tier: what is made for a recording alone
        keyframe_seconds: longest time between two keyframes; twice that on a path without room
        attached: whether the source is the console's own, and not the robot's
    """

    def __init__(
        self,
        codec: str,
        own_tier: Tier,
        take: FrameTaker,
        *,
        keyframe_seconds: float,
        attached: bool,
    ) -> None:
        self._codec = codec
        self._own_tier = own_tier
        self._take = take
        self._keyframe_seconds = keyframe_seconds
        self._attached = attached
        self._current: Output | None = None
        self._next: Output | None = None  # from its next keyframe on

    def choose(self, stream: RecordedStream) -> None:
        wanted = self._best(stream)
        if wanted is self._next or (wanted is self._current and self._next is None):
            return
        self._drop(self._next)
        self._next = None if wanted is self._current else wanted
        if self._next is not None:
            if not self._next.needed:
                self._next.plan = stream.full_plan
            self._next.recorded = True
            self._next.keyframes.longest = self._keyframe_seconds
            self._next.request_keyframe("record")

    def _best(self, stream: RecordedStream) -> Output:
        for tier in TIERS:
            found = stream.outputs.get((self._codec, tier))
            if found is not None and found.targets:
                return found
        return stream.output(self._codec, self._own_tier)

    def published(self, stream: str, output: Output, frame: EncodedFrame) -> None:
        if output is self._next and frame.keyframe:
            self._drop(self._current)
            self._current, self._next = output, None
        if output is self._current:
            self._take(stream, output.codec, frame, attached=self._attached)

    def request_keyframe(self) -> None:
        """A new file begins."""
        if self._current is not None:
            self._current.request_keyframe("record")

    def close(self) -> None:
        """Nothing is recorded any more."""
        for output in (self._current, self._next):
            self._drop(output)
        self._current = self._next = None

    @staticmethod
    def _drop(output: Output | None) -> None:
        if output is not None:
            output.recorded = False
            output.keyframes.longest = None
