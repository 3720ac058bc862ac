"""Frames waiting for one peer: bounded, newest wins, never a picture that cannot be decoded. No clock is read here."""

from collections import deque

from lockstep.server.media.pipeline.frame import EncodedFrame

__all__ = ["FrameQueue"]


class FrameQueue:
    """A queue that nothing leaves before the first keyframe or, when frames had to be dropped, before the next one.

    Every sound packet counts as a keyframe, so that for sound this is "keep the newest `capacity`".
    """

    def __init__(self, capacity: int, *, video: bool) -> None:
        self._capacity = capacity
        self._video = video
        self._frames: deque[EncodedFrame] = deque()
        self.waiting = True  # for a keyframe
        self.dropped = 0  # frames that this peer did not get because it could not keep up

    def put(self, frame: EncodedFrame) -> bool:
        """Queue a frame; False when frames were dropped and a keyframe is needed."""
        if self._video and frame.keyframe:
            self.dropped += len(self._frames)
            self._frames.clear()
        elif self._video and self.waiting:
            return True
        elif len(self._frames) >= self._capacity:
            return self._overflow(frame)
        self.waiting = False
        self._frames.append(frame)
        return True

    def _overflow(self, frame: EncodedFrame) -> bool:
        if not self._video:
            self._frames.popleft()
            self._frames.append(frame)
            self.dropped += 1
            return True
        self.dropped += len(self._frames) + 1
        self._frames.clear()
        self.waiting = True
        return False

    def peek(self) -> EncodedFrame | None:
        return self._frames[0] if self._frames else None

    def pop(self) -> None:
        self._frames.popleft()
