"""Which of a stream's encodings is recorded. Nothing is encoded twice for it where somebody already takes it."""

from collections.abc import Mapping
from typing import Protocol

from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.media.pipeline.passthrough import PASSED
from lockstep.server.media.pipeline.tier_encoding import TierEncoding
from lockstep.server.media.quality.encoding_target import EncodingTarget, PictureTier

__all__ = ["FrameTaker", "RecordedEncoding", "RecordedStream"]

TIERS: tuple[PictureTier, ...] = ("operator", "high", "crowd", "low")
HALF_A_PACKET = 0.010  # s of sound
CLOCK_JUMPED = 1.0  # s; what is that much older than what was taken is no repetition


class FrameTaker(Protocol):
    """The recorder. Called on the loop, returns at once."""

    def __call__(self, stream: str, codec: str, frame: EncodedFrame, *, attached: bool) -> None: ...


class RecordedStream(Protocol):
    """What it needs of the stream."""

    @property
    def name(self) -> str: ...
    @property
    def full_plan(self) -> EncodingTarget: ...
    @property
    def outputs(self) -> Mapping[tuple[str, PictureTier], TierEncoding]: ...
    @property
    def passed(self) -> TierEncoding | None: ...
    def output(self, codec: str, tier: PictureTier) -> TierEncoding: ...


class RecordedEncoding:
    """Call `choose` before each medium, `published` with each frame, `close` at the end.

    The operator's encoding comes first; then what a camera encoded itself; then that of observers. Where nobody takes
    the first codec it is what they take of the next one; one is made only where nothing is encoded. Another one is
    taken from its next keyframe on. A camera cannot be asked for one: ours is recorded until it comes.

    Of sound every packet is a keyframe. Where its codec changes, what the codec before brought is not taken again.

    Args:
        codecs: in which it can be recorded; in the first one, where that is encoded or nothing is
        own_tier: what is made for a recording alone
        keyframe_seconds: longest time between two keyframes; twice that on a path without room
        attached: whether the source is the console's own, and not the robot's
        sound: whether it is a microphone's
    """

    def __init__(
        self,
        codecs: tuple[str, ...],
        own_tier: PictureTier,
        take: FrameTaker,
        *,
        keyframe_seconds: float,
        attached: bool,
        sound: bool = False,
    ) -> None:
        self._codecs = codecs
        self._own_tier = own_tier
        self._take = take
        self._keyframe_seconds = keyframe_seconds
        self._attached = attached
        self._sound = sound
        self._last: tuple[TierEncoding, float] | None = None  # what was taken, and its time
        self._current: TierEncoding | None = None
        self._next: TierEncoding | None = None  # from its next keyframe on
        self._meanwhile: TierEncoding | None = None  # ours, until the camera's own first keyframe

    def choose(self, stream: RecordedStream) -> None:
        wanted = self._best(stream)
        if wanted is self._next or (wanted is self._current and self._next is None):
            return
        self._drop(self._next)
        self._next = None if wanted is self._current else wanted
        if wanted is self._meanwhile:
            self._meanwhile = None
        if self._next is not None:
            self._begin(self._next, stream)
            if self._current is None and wanted is stream.passed:
                self._meanwhile = self._ours(stream)
                self._begin(self._meanwhile, stream)

    def _begin(self, output: TierEncoding, stream: RecordedStream) -> None:
        if not output.needed:
            output.plan = stream.full_plan
        output.recorded = True
        output.keyframes.longest = self._keyframe_seconds
        output.request_keyframe("record")

    def _best(self, stream: RecordedStream) -> TierEncoding:
        operators = stream.outputs.get((self._codecs[0], "operator"))
        if operators is not None and operators.targets:
            return operators
        return stream.passed or self._ours(stream)

    def _ours(self, stream: RecordedStream) -> TierEncoding:
        """What we encode for somebody; where that is nobody, for the recording."""
        for codec in self._codecs:
            for tier in TIERS:
                found = stream.outputs.get((codec, tier))
                if found is not None and found.targets:
                    return stream.output(codec, "high") if tier == "crowd" else found  # all pictures, not a crowd's
        return stream.output(self._codecs[0], self._own_tier)

    def published(self, stream: str, output: TierEncoding, frame: EncodedFrame) -> None:
        if frame.keyframe and output is self._next:
            self._drop(self._current)
            self._drop(self._meanwhile)
            self._current, self._next, self._meanwhile = output, None, None
        elif frame.keyframe and output is self._meanwhile:
            self._current, self._meanwhile = output, None
        if output is self._current and not self._was_taken(output, frame):
            self._last = output, frame.time
            codec = self._codecs[0] if output.codec == PASSED else output.codec
            self._take(stream, codec, frame, attached=self._attached)

    def _was_taken(self, output: TierEncoding, frame: EncodedFrame) -> bool:
        """Whether this sound is recorded already, in another codec."""
        if not self._sound or self._last is None or self._last[0] is output:
            return False
        return 0 < self._last[1] + HALF_A_PACKET - frame.time < CLOCK_JUMPED

    def request_keyframe(self) -> None:
        """A new file begins."""
        if self._current is None:
            return
        if self._current.codec != PASSED:
            self._current.request_keyframe("record")
        else:  # a camera's own: what is recorded is chosen afresh, and begins with ours
            for output in (self._current, self._next):
                self._drop(output)
            self._current = self._next = None

    def close(self) -> None:
        """Nothing is recorded any more."""
        for output in (self._current, self._next, self._meanwhile):
            self._drop(output)
        self._current = self._next = self._meanwhile = None

    @staticmethod
    def _drop(output: TierEncoding | None) -> None:
        if output is not None:
            output.recorded = False
            output.keyframes.longest = None
