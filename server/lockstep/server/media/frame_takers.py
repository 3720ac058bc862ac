"""Shares the hub's recorded encodings between those who take them: the recorder, and the Foxglove server."""

from collections.abc import Mapping
from typing import Protocol

from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.media.pipeline.recorded_encoding import FrameTaker

__all__ = ["FrameTakers", "TakenMedia"]


class RecordingHub(Protocol):
    """The part of the media hub that is needed here."""

    def record(self, take: FrameTaker | None, keyframe_seconds: float = ...) -> None: ...
    def record_keyframes(self, *, afresh: bool = ...) -> None: ...
    def recorded_codecs(self) -> Mapping[str, str]: ...


class FrameTakers:
    """One encoding of each stream is recorded for all of them. Used on the loop."""

    def __init__(self, hub: RecordingHub) -> None:
        self._hub = hub
        self._taking: dict[TakenMedia, FrameTaker] = {}

    def add(self) -> "TakenMedia":
        """Return the media for one more taker."""
        return TakenMedia(self, self._hub)

    def begin(self, who: "TakenMedia", take: FrameTaker, keyframe_seconds: float) -> None:
        """Hand frames to `take`. The keyframes come as often as the first of those who take now asked for."""
        first = not self._taking
        self._taking[who] = take
        if first:
            self._hub.record(self._take, keyframe_seconds)
        else:
            self._hub.record_keyframes(afresh=False)

    def end(self, who: "TakenMedia", keyframe_seconds: float) -> None:
        """Hand no more frames to `who`. Idempotent."""
        if self._taking.pop(who, None) is not None and not self._taking:
            self._hub.record(None, keyframe_seconds)

    def _take(self, stream: str, codec: str, frame: EncodedFrame, *, attached: bool) -> None:
        for take in tuple(self._taking.values()):
            take(stream, codec, frame, attached=attached)


class TakenMedia:
    """The media of one taker, with the part of the hub's interface that a recorder uses.

    Frames of a stream come from a keyframe on, no matter since when another takes the stream.
    """

    def __init__(self, takers: FrameTakers, hub: RecordingHub) -> None:
        self._takers = takers
        self._hub = hub
        self._take: FrameTaker | None = None
        self._begun: set[str] = set()  # streams whose first keyframe has come

    def record(self, take: FrameTaker | None, keyframe_seconds: float) -> None:
        """Hand frames to `take` from now on; None ends it."""
        self._take = take
        self._begun.clear()
        if take is None:
            self._takers.end(self, keyframe_seconds)
        else:
            self._takers.begin(self, self._taken, keyframe_seconds)

    def request_keyframes(self) -> None:
        """Request keyframes, and change nothing for other takers. A camera that takes no requests gives one later."""
        self._hub.record_keyframes(afresh=False)

    def record_keyframes(self) -> None:
        """Request keyframes, because a new file begins."""
        self._hub.record_keyframes()

    def recorded_codecs(self) -> Mapping[str, str]:
        return self._hub.recorded_codecs()

    def _taken(self, stream: str, codec: str, frame: EncodedFrame, *, attached: bool) -> None:
        if frame.keyframe:
            self._begun.add(stream)
        if self._take is not None and stream in self._begun:
            self._take(stream, codec, frame, attached=attached)
