"""The process that speaks to Rerun. It reads the console's items from its standard input, and ends with it.

It is apart from the console because Rerun's library blocks while a viewer does not read, and takes the interpreter with
it: `python -m lockstep.server.rerun.rerun_process KIND VALUE FILE_BYTES`.
"""

import os
import pickle
import resource
import select
import signal
import socket
import sys
import time
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

import rerun as rr

from lockstep.server.recording.export.rerun.session_log import Moment, SessionLog, new_stream
from lockstep.server.recording.format.topics import PICTURE_FORMATS
from lockstep.server.recording.writing.queue_items import (
    FeedbackItem,
    Item,
    MediaItem,
    OwnItem,
    RobotItem,
    feedback_record,
)
from lockstep.server.rerun.feed import LENGTH

__all__ = ["Pipe", "Sink", "take_items"]

NICE: Final = 10  # whoever drives goes first
SEND_SECONDS: Final = 0.1  # between two batches of rows for those who look on
FILE_SECONDS: Final = 1.0  # and for a file, which is a quarter as large then
MEMORY: Final = 4_000_000_000  # bytes of addresses, about 3 of them for libraries and threads that use little
EARLY: Final = 64  # items
CONNECT_SECONDS: Final = 2.0
SERVER_MEMORY: Final = "256MB"  # that those who connect later get
READ_BYTES: Final = 1 << 16
FAILED: Final = 3  # exit code


class Sink:
    """Where recordings go: one for each epoch.

    Args:
        kind: "file", "viewer" or "server"
        value: the file's path, the viewer's address, the port
        file_bytes: a file ends when it is larger

    Attributes:
        seconds: between two batches of rows
    """

    def __init__(self, kind: str, value: str, file_bytes: int) -> None:
        self._kind = kind
        self._value = value
        self._file_bytes = file_bytes
        self._path: Path | None = None
        self.seconds = FILE_SECONDS if kind == "file" else SEND_SECONDS

    def open(self, stream: rr.RecordingStream) -> None:
        """Attach the sink.

        Raises:
            OSError: the viewer cannot be reached, or the file cannot be written.
        """
        match self._kind:
            case "file":
                self._path = _free(Path(self._value))
                stream.save(str(self._path))
            case "viewer":
                _check_reached(self._value)  # Rerun would wait for it without end, and keep what it gets
                stream.connect_grpc(self._value)
            case _:
                stream.serve_grpc(grpc_port=int(self._value), server_memory_limit=SERVER_MEMORY)

    def is_full(self) -> bool:
        """Return whether the file has reached its bound."""
        return self._path is not None and self._path.stat().st_size >= self._file_bytes


def _free(path: Path) -> Path:
    """Create and return the file, or the first of name-2, name-3, … that is not there yet: nothing is overwritten."""
    path.parent.mkdir(parents=True, exist_ok=True)
    for number in range(1, 10_000):
        found = path if number == 1 else path.with_stem(f"{path.stem}-{number}")
        with suppress(FileExistsError):
            found.open("xb").close()
            return found
    raise FileExistsError(f"{path}: there are too many")


def _check_reached(address: str) -> None:
    parts = urlsplit(address)
    socket.create_connection((parts.hostname or "", parts.port or 0), CONNECT_SECONDS).close()


def take_items(items: Iterator[Item | None], sink: Sink) -> None:
    """Log items until they end. None among them: nothing has come for a while.

    Raises:
        OSError: the sink cannot be used, or is full.
    """
    epoch = ""
    session: SessionLog | None = None
    stream: rr.RecordingStream | None = None
    sent = time.monotonic()
    early: deque[Item] = deque(maxlen=EARLY)  # the state that holds is told before the robot that it belongs to
    try:
        for item in items:
            if session is None and item is not None and not isinstance(item, RobotItem):
                early.append(item)
            if isinstance(item, RobotItem):
                if item.record.epoch != epoch or session is None:
                    _end(session, stream)
                    epoch, stream = item.record.epoch, new_stream("", item.record.epoch)
                    sink.open(stream)
                    session = SessionLog(stream)
                session.begin(item.record.description)
                while early:
                    _take(early.popleft(), session, epoch)
            if item is not None and session is not None:
                _take(item, session, epoch)
            now = time.monotonic()
            if session is not None and now - sent >= sink.seconds:
                sent = now
                session.flush()
                if sink.is_full():
                    raise OSError("the file has reached its bound")
    finally:
        _end(session, stream)


def _end(session: SessionLog | None, stream: rr.RecordingStream | None) -> None:
    if session is not None and stream is not None:
        session.flush()
        stream.flush()
        stream.disconnect()


def _take(item: Item, session: SessionLog, epoch: str) -> None:
    match item:
        case MediaItem(stream=stream, codec=codec, stamp=stamp) if item.epoch == epoch:
            at = Moment(stamp, item.arrived, item.captured)
            if codec in PICTURE_FORMATS:
                session.picture(stream, PICTURE_FORMATS[codec], item.data, at, keyframe=item.keyframe)
        case FeedbackItem(feedback=feedback) if item.epoch == epoch:
            session.own(feedback_record(item), Moment(feedback.event, item.arrived, item.captured))
        case RobotItem(record=record) | OwnItem(record=record) if record.epoch == epoch:
            session.own(record, Moment(record.event, item.arrived, item.arrived))


class Pipe:
    """Reads the console's items, in their order, from a descriptor. Iteration ends with the console."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._waiting = bytearray()

    def __iter__(self) -> Iterator[Item | None]:
        """Yield items; None when nothing came for a while."""
        while True:
            if not select.select([self._descriptor], [], [], SEND_SECONDS)[0]:
                yield None
                continue
            data = os.read(self._descriptor, READ_BYTES)
            if not data:
                return
            self._waiting += data
            yield from self._whole()

    def _whole(self) -> Iterator[Item]:
        at, waiting = 0, self._waiting
        while len(waiting) - at >= LENGTH:
            end = at + LENGTH + int.from_bytes(waiting[at : at + LENGTH], "big")
            if len(waiting) < end:
                break
            yield from pickle.loads(bytes(waiting[at + LENGTH : end]))  # of the console, which started this process
            at = end
        del waiting[:at]


def main() -> None:
    """Run the process."""
    kind, value, file_bytes = sys.argv[1:]
    os.nice(NICE)
    for number in (signal.SIGINT, signal.SIGTERM):  # the console gets them too, and its end is the end of the items
        signal.signal(number, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    os.write(sys.stdout.fileno(), b"ready\n")
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # nobody reads what a library might print
    try:
        take_items(iter(Pipe(sys.stdin.fileno())), Sink(kind, value, int(file_bytes)))
    except OSError as error:
        sys.stderr.write(f"lockstep: Rerun, {value}: {error.strerror or error}\n")
        sys.exit(FAILED)


if __name__ == "__main__":
    main()
