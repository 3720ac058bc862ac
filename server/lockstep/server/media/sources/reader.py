"""The process of one attached source: opens it, reads it, tries again when it fails, and writes the captured media.

A demuxer and a decoder take whatever a network or a device sends them. In this process they can neither block the
console's event loop nor crash the console. The source to open comes over standard input and not as an argument, which
other users could read; the end of the input means that the console has gone.
"""

import os
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import BinaryIO

import msgspec
from av.error import FFmpegError

from lockstep.server.media.sources.errors import SourceError, reason_of
from lockstep.server.media.sources.picture_source import read_pictures
from lockstep.server.media.sources.sound_source import read_sound
from lockstep.server.media.sources.source_url import SourceSpec
from lockstep.server.media.sources.source_wire import SAID, Captured, Said, Trouble, Working
from lockstep.server.util.backoff import Backoff

__all__ = ["main", "read_source"]

FIRST_WAIT, LONGEST_WAIT = 0.5, 8.0  # s until a source that failed is tried again
HEALTHY = 10.0  # s that a source has to work until its next failure counts as the first


def read_source(spec: SourceSpec, say: Callable[[Said], None], sleep: Callable[[float], None] = time.sleep) -> None:
    """Read a source until `say` raises OSError: nobody listens any more."""
    backoff = Backoff(FIRST_WAIT, LONGEST_WAIT)
    read = read_pictures if spec.kind == "video" else read_sound
    while True:
        began: float | None = None

        def working(detail: str) -> None:
            nonlocal began
            if began is None:
                began = time.monotonic()
                say(Working(detail))

        def captured(what: Captured) -> None:
            try:
                say(what)
            except OSError as error:
                raise _Unheard from error

        try:
            read(spec, working, captured)
            say(Trouble("ended", "the source ended"))
        except _Unheard:
            return
        except (SourceError, FFmpegError, OSError, ValueError) as error:
            say(Trouble(*reason_of(error)))
        except Exception as error:  # unexpected error of a library; its text may hold the address
            say(Trouble("failed", type(error).__name__))
        if began is not None and time.monotonic() - began > HEALTHY:
            backoff.healthy()
        sleep(backoff.next())


class _Unheard(Exception):
    """The console does not listen any more."""


def main() -> None:
    spec = msgspec.json.Decoder(SourceSpec).decode(sys.stdin.buffer.readline())
    out = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # output that a library prints is not a message
    threading.Thread(target=_end_with, args=(sys.stdin.buffer,), daemon=True).start()
    with suppress(OSError, KeyboardInterrupt):
        read_source(spec, lambda said: SAID.write(out, said))
    os._exit(0)  # a device that hangs holds nobody up


def _end_with(console: BinaryIO) -> None:
    """Exit when the console has gone: a call that reads a device cannot be interrupted."""
    console.read()
    os._exit(0)


if __name__ == "__main__":
    main()
