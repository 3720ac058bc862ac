"""The stage that chooses the encoding of a stream to record. One that somebody already takes is not made twice."""

from typing import Protocol

from lockstep.server.media.encoding.stream_encodings import PASSED, StreamEncodings
from lockstep.server.media.encoding.tier_encoding import TierEncoding
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.media.pipeline.stage import FrameStage
from lockstep.server.media.quality.encoding_target import PictureTier

__all__ = ["FrameTaker", "RecordedEncoding"]

TIERS: tuple[PictureTier, ...] = ("operator", "high", "crowd", "low")
HALF_A_PACKET = 0.010  # s of sound
CLOCK_JUMPED = 1.0  # s; sound older than the last recorded by that much is not a repetition


class FrameTaker(Protocol):
    """The recorder. Called on the loop, returns at once."""

    def __call__(self, stream: str, codec: str, frame: EncodedFrame, *, attached: bool) -> None: ...


class RecordedEncoding(FrameStage):
    """Between `record` and `stop`, hands the frames of the chosen encoding to the recorder, after the fan-out.

    The operator's encoding is preferred, then the camera's own, then that of observers. If nobody takes the first
    codec, an encoding in the next one is recorded; a separate one is made only if nothing is encoded. A change takes
    effect at the new encoding's next keyframe. A camera takes no keyframe requests: the console's encoding is recorded
    until its keyframe comes.

    Every sound packet is a keyframe. When the codec changes, sound already recorded in the former is not taken again.

    Attributes:
        codecs: possible codecs of the recording; the first one is used if it, or nothing, is encoded
    """

    def __init__(
        self,
        following: FrameStage,
        encodings: StreamEncodings,
        own_tier: PictureTier,
        *,
        attached: bool,
        sound: bool = False,
    ) -> None:
        """Recording begins with `record`.

        Args:
            own_tier: tier of an encoding for the recording alone
            attached: True for a source of the console, False for one of the robot
            sound: True for a microphone
        """
        super().__init__(following)
        self.codecs = tuple(sorted(encodings.codecs, key=lambda codec: codec not in ("H264", "opus")))
        self._encodings = encodings
        self._own_tier = own_tier
        self._attached = attached
        self._sound = sound
        self._take: FrameTaker | None = None  # None: nothing is recorded
        self._keyframe_seconds = 0.0
        self._last: tuple[TierEncoding, float] | None = None  # encoding and time of the last recorded frame
        self._current: TierEncoding | None = None
        self._next: TierEncoding | None = None  # from its next keyframe on
        self._meanwhile: TierEncoding | None = None  # the console's, until the camera's first keyframe

    def record(self, take: FrameTaker, keyframe_seconds: float) -> None:
        """Hand frames to `take` from now on; keyframes come that often, half as often on a path without room."""
        self.stop()
        self._take, self._keyframe_seconds = take, keyframe_seconds

    def stop(self) -> None:
        """Stop recording."""
        self._take = self._last = None
        for encoding in (self._current, self._next, self._meanwhile):
            self._drop(encoding)
        self._current = self._next = self._meanwhile = None

    @property
    def takes(self) -> bool:
        """True while the stream is recorded."""
        return self._take is not None

    def choose_for_next(self) -> bool:
        """Choose the encoding that is recorded of the next frame. Return whether anybody takes that frame."""
        if self._take is None:
            return self._encodings.is_taken
        self._choose()
        return True

    def _choose(self) -> None:
        wanted = self._best()
        if wanted is self._next or (wanted is self._current and self._next is None):
            return
        self._drop(self._next)
        self._next = None if wanted is self._current else wanted
        if wanted is self._meanwhile:
            self._meanwhile = None
        if self._next is not None:
            self._begin(self._next)
            if self._current is None and wanted is self._encodings.passed and not self._encodings.follows:
                self._meanwhile = self._own()
                self._begin(self._meanwhile)

    def _begin(self, encoding: TierEncoding) -> None:
        if not encoding.needed:
            encoding.plan = self._encodings.full
        encoding.recorded = True
        encoding.keyframes.longest = self._keyframe_seconds
        encoding.request_keyframe("record")

    def _best(self) -> TierEncoding:
        operators = self._encodings.own.find(self.codecs[0], "operator")
        if operators is not None and operators.targets:
            return operators
        if self._encodings.passed is not None and self._encodings.passes:
            return self._encodings.passed
        return self._own()

    def _own(self) -> TierEncoding:
        """Return an encoding of the console that somebody takes; without one, an encoding for the recording."""
        for codec in self.codecs:
            for tier in TIERS:
                found = self._encodings.own.find(codec, tier)
                if found is not None and found.targets:  # all pictures, not a crowd's
                    return self._encodings.own.get(codec, "high") if tier == "crowd" else found
        return self._encodings.own.get(self.codecs[0], self._own_tier)

    def encoded(self, frame: EncodedFrame, encoding: TierEncoding) -> None:
        super().encoded(frame, encoding)
        if self._take is None:
            return
        if frame.keyframe and encoding is self._next:
            self._drop(self._current)
            self._drop(self._meanwhile)
            self._current, self._next, self._meanwhile = encoding, None, None
        elif frame.keyframe and encoding is self._meanwhile:
            self._current, self._meanwhile = encoding, None
        if encoding is self._current and not self._was_taken(encoding, frame):
            self._last = encoding, frame.time
            codec = self.codecs[0] if encoding.codec == PASSED else encoding.codec
            self._take(self._encodings.stream, codec, frame, attached=self._attached)

    def _was_taken(self, encoding: TierEncoding, frame: EncodedFrame) -> bool:
        """True if this sound is recorded already, in another codec."""
        if not self._sound or self._last is None or self._last[0] is encoding:
            return False
        return 0 < self._last[1] + HALF_A_PACKET - frame.time < CLOCK_JUMPED

    def request_keyframe(self, *, afresh: bool = True) -> None:
        """Request a keyframe.

        `afresh`: for a new file, which cannot wait for a camera that takes no requests: the console's encoding is
        recorded until that camera's next keyframe. Else the one who asks waits, and what is recorded stays as it is.
        """
        if self._current is None:
            return
        if self._current.codec != PASSED or self._encodings.follows:
            self._current.request_keyframe("record")
        elif afresh:  # a camera's own: the encoding is chosen afresh, and the console's comes first
            for encoding in (self._current, self._next):
                self._drop(encoding)
            self._current = self._next = None

    @staticmethod
    def _drop(encoding: TierEncoding | None) -> None:
        if encoding is not None:
            encoding.recorded = False
            encoding.keyframes.longest = None
