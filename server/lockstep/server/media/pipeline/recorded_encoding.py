"""Chooses the encoding of a stream to record. An encoding that somebody already takes is not made twice."""

from collections.abc import Mapping
from typing import Protocol

from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.media.pipeline.passthrough import PASSED
from lockstep.server.media.pipeline.tier_encoding import TierEncoding
from lockstep.server.media.quality.encoding_target import EncodingTarget, PictureTier

__all__ = ["FrameTaker", "RecordedEncoding", "RecordedStream"]

TIERS: tuple[PictureTier, ...] = ("operator", "high", "crowd", "low")
HALF_A_PACKET = 0.010  # s of sound
CLOCK_JUMPED = 1.0  # s; sound older than the last recorded by that much is not a repetition


class FrameTaker(Protocol):
    """The recorder. Called on the loop, returns at once."""

    def __call__(self, stream: str, codec: str, frame: EncodedFrame, *, attached: bool) -> None: ...


class RecordedStream(Protocol):
    """The part of a stream that is needed here."""

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

    The operator's encoding is preferred, then the camera's own, then that of observers. If nobody takes the first
    codec, an encoding in the next one is recorded; a separate one is made only if nothing is encoded. A change takes
    effect at the new encoding's next keyframe. A camera takes no keyframe requests: the console's encoding is recorded
    until its keyframe comes.

    Every sound packet is a keyframe. When the codec changes, sound already recorded in the former is not taken again.

    Args:
        codecs: possible codecs of the recording; the first one is used if it, or nothing, is encoded
        own_tier: tier of an encoding for the recording alone
        keyframe_seconds: longest time between two keyframes; twice that on a path without room
        attached: True for a source of the console, False for one of the robot
        sound: True for a microphone
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
        self._last: tuple[TierEncoding, float] | None = None  # encoding and time of the last recorded frame
        self._current: TierEncoding | None = None
        self._next: TierEncoding | None = None  # from its next keyframe on
        self._meanwhile: TierEncoding | None = None  # the console's, until the camera's first keyframe

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
        """Return an encoding of the console that somebody takes; without one, an encoding for the recording."""
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
        """True if this sound is recorded already, in another codec."""
        if not self._sound or self._last is None or self._last[0] is output:
            return False
        return 0 < self._last[1] + HALF_A_PACKET - frame.time < CLOCK_JUMPED

    def request_keyframe(self) -> None:
        """Request a keyframe for a new file."""
        if self._current is None:
            return
        if self._current.codec != PASSED:
            self._current.request_keyframe("record")
        else:  # a camera's own: the encoding is chosen afresh, and the console's comes first
            for output in (self._current, self._next):
                self._drop(output)
            self._current = self._next = None

    def close(self) -> None:
        """Stop recording."""
        for output in (self._current, self._next, self._meanwhile):
            self._drop(output)
        self._current = self._next = self._meanwhile = None

    @staticmethod
    def _drop(output: TierEncoding | None) -> None:
        if output is not None:
            output.recorded = False
            output.keyframes.longest = None
