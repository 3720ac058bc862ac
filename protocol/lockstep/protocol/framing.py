"""Frames on the robot link: a 4-byte big-endian length, then that many bytes. No I/O."""

from collections.abc import Generator

from lockstep.protocol.errors import FramingError

__all__ = ["MAX_CONTROL_FRAME", "MAX_HELLO_FRAME", "MAX_MEDIA_FRAME", "FrameReader", "frame"]

HEADER = 4
MAX_HELLO_FRAME = 8 << 10  # bytes from a client that is not admitted yet
MAX_CONTROL_FRAME = 1 << 20  # bytes; a description with its kinematic model is the largest
LARGE_FRAME = 64 << 10  # bytes from which on a frame gets a buffer of its own
MAX_MEDIA_FRAME = 16 << 20  # bytes; a raw 4:2:0 picture of 3840x2160 is 12.4 MB


def frame(payload: bytes) -> bytes:
    """`payload` with its length in front."""
    return len(payload).to_bytes(HEADER, "big") + payload


class FrameReader:
    """Cuts a byte stream into frames.

    Pass received bytes to `feed`, then iterate `frames`. The length is checked against the bound before the
    frame's bytes are waited for, so that at most `max_frame` bytes plus one read are ever kept. `max_frame` may be
    changed between frames.
    """

    def __init__(self, max_frame: int) -> None:
        self.max_frame = max_frame
        self._buffer = bytearray()
        self._large: bytearray | None = None  # a frame that is being filled, so that its bytes are copied once
        self._filled = 0  # bytes of it

    @property
    def missing(self) -> int:
        """Bytes that a large frame still needs; 0: none is being read."""
        return 0 if self._large is None else len(self._large) - self._filled

    def feed(self, data: bytes) -> None:
        if self._large is None:
            self._buffer += data
            return
        taken = min(len(data), len(self._large) - self._filled)
        self._large[self._filled : self._filled + taken] = data if taken == len(data) else memoryview(data)[:taken]
        self._filled += taken
        self._buffer += data[taken:]

    def frames(self) -> Generator[bytes | bytearray]:
        """The complete frames so far.

        Raises:
            FramingError: a frame is empty or longer than the bound. The stream cannot be read on.
        """
        position = 0
        try:
            while True:
                if self._large is not None:
                    if self._filled < len(self._large):
                        break
                    whole, self._large = self._large, None
                    yield whole
                    continue
                start = position + HEADER
                if len(self._buffer) < start:
                    break
                length = int.from_bytes(self._buffer[position:start], "big")
                if not 0 < length <= self.max_frame:
                    raise FramingError(f"a frame of {length} bytes, the bound is 1 to {self.max_frame}")
                if len(self._buffer) - start < length:
                    if length >= LARGE_FRAME:
                        position = self._begin_large(length, start)
                    break
                position = start + length
                yield bytes(self._buffer[start:position])
        finally:
            del self._buffer[:position]

    def _begin_large(self, length: int, start: int) -> int:
        """Move the part that is there; returns how far the buffer was used up."""
        self._large, self._filled = bytearray(length), len(self._buffer) - start
        self._large[: self._filled] = memoryview(self._buffer)[start:]
        return len(self._buffer)

    @property
    def has_frame(self) -> bool:
        """Whether `frames` would bring one, or an error."""
        if self._large is not None:
            return self._filled == len(self._large)
        if len(self._buffer) < HEADER:
            return False
        length = int.from_bytes(self._buffer[:HEADER], "big")
        return not 0 < length <= self.max_frame or len(self._buffer) - HEADER >= length

    def at_end(self) -> None:
        """Call at end of stream.

        Raises:
            FramingError: the stream ended inside a frame.
        """
        inside = HEADER + self._filled if self._large is not None else len(self._buffer)
        if inside:
            raise FramingError(f"the stream ended {inside} bytes into a frame")
