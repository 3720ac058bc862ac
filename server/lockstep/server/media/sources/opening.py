"""Opens a source with PyAV."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

import av
from av.container import InputContainer

from lockstep.server.media.sources.errors import FellBehind
from lockstep.server.media.sources.source_url import SourceSpec

__all__ = ["Pace", "kernel_time", "opened", "settled_lag"]

OPEN_TIMEOUT, READ_TIMEOUT = 8.0, 3.0  # s
MOST_LAG = 5.0  # s behind the quickest; beyond it the backlog is given up by connecting anew
KERNEL_AGE = 10.0  # s; a time stamp of the kernel's monotonic clock is not older than that


@contextmanager
def opened(spec: SourceSpec) -> Iterator[InputContainer]:
    """Open a source. Raises FFmpegError or OSError, whose text holds the address."""
    form, options = _form(spec)
    timeout = (OPEN_TIMEOUT, READ_TIMEOUT) if spec.live else None
    with av.open(spec.address, format=form, options=options, timeout=timeout) as container:
        yield container


def _form(spec: SourceSpec) -> tuple[str | None, dict[str, str]]:
    if spec.scheme == "v4l2":
        options = {"timestamps": "default"}  # the kernel's own
        if spec.size is not None:
            options["video_size"] = f"{spec.size[0]}x{spec.size[1]}"
        if spec.rate is not None:
            options["framerate"] = f"{spec.rate:g}"
        if spec.form:
            options["input_format"] = spec.form
        return "v4l2", options
    if spec.scheme == "alsa":
        return "alsa", {"sample_rate": f"{spec.rate or 48000:.0f}", "channels": str(spec.channels)}
    if spec.scheme == "file":
        return None, {}
    # A longer analysis before the first picture would only delay it.
    options = {"fflags": "nobuffer", "analyzeduration": "1000000", "probesize": "1000000"}
    if spec.scheme in ("rtsp", "rtsps"):
        options["rtsp_transport"] = spec.transport
    return None, options


def kernel_time(start: float | None, now: float) -> float | None:
    """Return `start` if it is a time of the kernel's monotonic clock, as used by `time.monotonic`; else None."""
    return start if start is not None and 0 <= now - start <= KERNEL_AGE else None


def settled_lag(lag: float) -> None:
    """Raise FellBehind if the source is too late to catch up."""
    if lag > MOST_LAG:
        raise FellBehind(f"the data arrived {lag:.0f} s late")


class Pace:
    """Paces a file's media at the speed of their own time."""

    def __init__(self) -> None:
        self._origin: float | None = None

    def wait(self, time_in_file: float) -> float:
        """Sleep until a medium is due; return the time now."""
        now = time.monotonic()
        if self._origin is None:
            self._origin = now - time_in_file
        due = self._origin + time_in_file
        if not -1.0 < due - now < 5.0:  # the file's time jumped, or we were held up
            self._origin, due = now - time_in_file, now
        if due > now:
            time.sleep(due - now)
        return time.monotonic()
