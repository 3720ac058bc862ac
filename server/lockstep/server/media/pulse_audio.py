"""PulseAudio (or PipeWire in its place) through its own small client library, `libpulse-simple`."""

import ctypes
from types import TracebackType
from typing import Any, Self

__all__ = ["PulseStream"]

PLAYBACK, RECORD = 1, 2
S16LE = 3
NAME = b"Lockstep"
UNSET = 0xFFFFFFFF


class _SampleSpec(ctypes.Structure):
    _fields_ = [("format", ctypes.c_int), ("rate", ctypes.c_uint32), ("channels", ctypes.c_uint8)]


class _BufferAttributes(ctypes.Structure):
    _fields_ = [(name, ctypes.c_uint32) for name in ("maxlength", "tlength", "prebuf", "minreq", "fragsize")]


class PulseStream:
    """A stream of 16-bit samples, interleaved. Calls block; use it from one thread."""

    def __init__(self, direction: int, device: str, rate: int, channels: int, buffer: _BufferAttributes) -> None:
        """Open a stream; `device` "" is the default one. Raises OSError if there is no PulseAudio, or it refuses."""
        self._library = _load()
        self._frame = 2 * channels  # bytes
        error = ctypes.c_int()
        spec = _SampleSpec(S16LE, rate, channels)
        name = device.encode() or None
        self._stream = self._library.pa_simple_new(
            None, NAME, direction, name, b"voice", ctypes.byref(spec), None, ctypes.byref(buffer), ctypes.byref(error)
        )
        if not self._stream:
            raise OSError(f"PulseAudio: {self._words(error)}")

    @classmethod
    def recording(cls, device: str, rate: int, channels: int, count: int) -> Self:
        """Open a stream that records `count` samples at a time."""
        fragment = count * 2 * channels
        return cls(RECORD, device, rate, channels, _BufferAttributes(UNSET, UNSET, UNSET, UNSET, fragment))

    @classmethod
    def playing(cls, device: str, rate: int, channels: int, buffered: int) -> Self:
        """Open a stream that plays; it buffers at most about `buffered` samples and begins with a fifth of that."""
        size = buffered * 2 * channels
        prebuffer = size // 5 // (2 * channels) * 2 * channels
        return cls(PLAYBACK, device, rate, channels, _BufferAttributes(2 * size, size, prebuffer, UNSET, UNSET))

    def read(self, count: int) -> bytes:
        """Read `count` samples of each channel. Raises OSError when the server has gone."""
        data = ctypes.create_string_buffer(count * self._frame)
        error = ctypes.c_int()
        if self._library.pa_simple_read(self._stream, data, len(data.raw), ctypes.byref(error)) < 0:
            raise OSError(f"PulseAudio: {self._words(error)}")
        return data.raw

    def write(self, samples: bytes) -> None:
        """Play samples. Raises OSError when the server has gone."""
        error = ctypes.c_int()
        if self._library.pa_simple_write(self._stream, samples, len(samples), ctypes.byref(error)) < 0:
            raise OSError(f"PulseAudio: {self._words(error)}")

    def close(self) -> None:
        """Close the stream. Idempotent."""
        stream, self._stream = self._stream, None
        if stream:
            self._library.pa_simple_free(stream)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _words(self, error: ctypes.c_int) -> str:
        text: bytes = self._library.pa_strerror(error)
        return text.decode(errors="replace")


def _load() -> Any:
    """Load the library. Raises OSError when it is not installed."""
    library = ctypes.CDLL("libpulse-simple.so.0")
    library.pa_simple_new.restype = ctypes.c_void_p
    library.pa_simple_new.argtypes = [
        *(ctypes.c_char_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p),
        *(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p),
    ]
    for name in ("pa_simple_read", "pa_simple_write"):
        function = getattr(library, name)
        function.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_size_t, ctypes.c_void_p]
    library.pa_simple_free.argtypes = [ctypes.c_void_p]
    library.pa_simple_free.restype = None
    library.pa_strerror.argtypes = [ctypes.c_int]
    library.pa_strerror.restype = ctypes.c_char_p
    return library
