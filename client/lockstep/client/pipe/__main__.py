"""Serves the standard input and output until the input ends, or the process that wants it: `… [ITS NUMBER]`."""

import asyncio
import logging
import os
import signal
import sys
from collections.abc import Sequence
from contextlib import suppress
from typing import BinaryIO

from lockstep.client.pipe.server import PipeServer
from lockstep.protocol.pipe.parent_process import parent_ended, parent_of
from lockstep.protocol.pipe.pipe_frames import BadFrame


async def serve(output: BinaryIO, parent: int) -> None:
    """Serve until the process `parent` ends. Frames go to `output`; nothing else may write there.

    Raises:
        BadFrame: the other side does not speak in frames.
    """
    loop = asyncio.get_running_loop()
    # Ctrl-C reaches all processes of a terminal; the one that started this process ends it in order, by its pipe.
    loop.add_signal_handler(signal.SIGINT, lambda: None)
    reader = asyncio.StreamReader()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)

    def write_now(parts: Sequence[bytes | memoryview]) -> None:
        output.writelines(parts)
        output.flush()

    async def write(parts: Sequence[bytes | memoryview]) -> None:
        await asyncio.to_thread(write_now, parts)

    async with PipeServer(reader, write) as server:
        try:
            async with asyncio.TaskGroup() as tasks:
                serving = tasks.create_task(_until_gone(server), name="requests")
                loop.add_signal_handler(signal.SIGTERM, serving.cancel)
                # Processes that the other side has forked may keep the pipe open beyond its end.
                ended = tasks.create_task(parent_ended(parent), name="parent")
                await asyncio.wait([serving, ended], return_when=asyncio.FIRST_COMPLETED)
                for task in (ended, serving):
                    task.cancel()
        except BaseExceptionGroup as errors:  # of `_until_gone`
            raise errors.exceptions[0] from None


async def _until_gone(server: PipeServer) -> None:
    with suppress(BrokenPipeError):  # the other side has gone, and needs no answer
        await server.serve()


def main() -> None:
    logging.basicConfig(level=logging.WARNING, format="lockstep: %(levelname)s %(name)s: %(message)s")
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # a library that prints must not print into the frames
    try:
        asyncio.run(serve(output, parent_of(sys.argv[1:])))
    except BadFrame as error:
        sys.exit(f"lockstep: {error}")


if __name__ == "__main__":
    main()
