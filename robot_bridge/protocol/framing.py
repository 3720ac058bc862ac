"""Frames on the robot link: a 4-byte big-endian length, then that many bytes. No I/O."""

from collections.abc import Iterator

from robot_bridge.protocol.errors import FramingError

__all__ = ["MAX_CONTROL_FRAME", "MAX_HELLO_FRAME", "MAX_MEDIA_FRAME", "FrameReader", "frame"]

HEADER = 4
MAX_HELLO_FRAME = 8 << 10  # bytes from a client that is not admitted yet
MAX_CONTROL_FRAME = 1 << 20  # bytes; a description with its kinematic model is the largest
MAX_MEDIA_FRAME = 16 << 20  # bytes; a raw 4:2:0 picture of 3840x2160 is 12.4 MB


def frame(payload: bytes) -> bytes:
    """`payload` with its length in front."""
    return len(payload).to_bytes(HEADER, "big") + payload


class FrameReader:
    """Cuts a byte stream into frames.

    Feed what was read with `feed`, then iterate `frames`. The length is checked against the bound before the
    frame's bytes are waited for, so that at most `max_frame` bytes plus one read are ever kept. `max_frame` may be
    changed between frames.
    """

    def __init__(self, max_frame: int) -> None:
        self.max_frame = max_frame
        self._buffer = bytearray()

    def feed(self, data: bytes) -> None:
        self._buffer += data

    def frames(self) -> Iterator[bytes]:
        """The complete frames so far.

        Raises:
            FramingError: a frame is empty or longer than the bound. The stream cannot be read on.
        """
        position = 0
        try:
            while len(self._buffer) - position >= HEADER:
                length = int.from_bytes(self._buffer[position : position + HEADER], "big")
                if not 0 < length <= self.max_frame:
                    raise FramingError(f"a frame of {length} bytes, the bound is 1 to {self.max_frame}")
                if len(self._buffer) - position - HEADER < length:
                    break
                start = position + HEADER
                position = start + length
                yield bytes(self._buffer[start:position])
        finally:
            del self._buffer[:position]

    def at_end(self) -> None:
        """Call at end of stream.

        Raises:
            FramingError: the stream ended inside a frame.
        """
        if self._buffer:
            raise FramingError(f"the stream ended {len(self._buffer)} bytes into a frame")
