"""The connections that flood a server, in their process."""

import asyncio
import socket
import sys

from tests.waiting import PATIENCE

COUNT = 30
PIPE = asyncio.subprocess.PIPE


async def test_the_end_of_a_flood_leaves_no_traceback() -> None:
    loop = asyncio.get_running_loop()
    with socket.create_server(("127.0.0.1", 0), backlog=COUNT) as server:
        server.setblocking(False)
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "lockstep.bench.viewers.connection_flood"),
            *(str(server.getsockname()[1]), "floods", str(COUNT)),
            stdin=PIPE,
            stdout=PIPE,
            stderr=PIPE,
        )
        assert process.stdout is not None
        async with asyncio.timeout(PATIENCE):
            await process.stdout.readline()
            taken, _ = await loop.sock_accept(server)
            with taken:  # it and others wait for an answer when the process is told to end
                _, errors = await process.communicate(b"")
    assert (process.returncode, errors.decode()) == (0, "")
