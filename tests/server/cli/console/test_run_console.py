"""The console's process: it lives as long as what it runs."""

import asyncio
import os
import socket
import sys
from asyncio.subprocess import DEVNULL, PIPE
from contextlib import closing
from pathlib import Path

from tests.server.rig import PATIENCE

FAILS_WHEN_TOLD = """
import asyncio, sys
from lockstep.server.control.console import Console

async def run(self):
    await asyncio.to_thread(sys.stdin.readline)
    raise OSError("planted")

Console.run = run
from lockstep.robot_bridge.entry import main
main()
"""


async def test_a_console_whose_session_has_failed_ends_and_says_so(tmp_path: Path) -> None:
    """Whoever supervises it starts it again; else it would answer every STOP with a failure for ever."""
    command = [sys.executable, "-c", FAILS_WHEN_TOLD, "serve", "--robot", "tcp://127.0.0.1:1", "--port", "0"]
    environment = os.environ | {"XDG_STATE_HOME": str(tmp_path)}
    process = await asyncio.create_subprocess_exec(*command, env=environment, stdin=PIPE, stdout=DEVNULL, stderr=PIPE)
    assert process.stdin is not None
    assert process.stderr is not None
    try:
        async with asyncio.timeout(2 * PATIENCE):
            while b"waiting for the robot" not in await process.stderr.readline():
                pass
            process.stdin.write(b"\n")
            _, said = await process.communicate()
    finally:
        if process.returncode is None:
            process.kill()
    assert process.returncode == 1, said.decode()
    assert "planted" in said.decode()
    assert "the console has failed" in said.decode()


async def test_the_service_manager_hears_that_the_console_listens_lives_and_ends(tmp_path: Path) -> None:
    address = str(tmp_path / "notify")
    with closing(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)) as manager:
        manager.bind(address)
        manager.setblocking(False)
        watched = {"NOTIFY_SOCKET": address, "WATCHDOG_USEC": "200000"}
        environment = os.environ | watched | {"XDG_STATE_HOME": str(tmp_path)}
        program = str(Path(sys.executable).with_name("lockstep"))
        command = [program, "serve", "--robot", "tcp://127.0.0.1:1", "--port", "0"]
        process = await asyncio.create_subprocess_exec(*command, env=environment, stdout=DEVNULL, stderr=DEVNULL)
        loop = asyncio.get_running_loop()
        try:
            async with asyncio.timeout(2 * PATIENCE):
                heard = [await loop.sock_recv(manager, 100) for _ in range(3)]
                process.terminate()
                while (last := await loop.sock_recv(manager, 100)) == b"WATCHDOG=1":
                    pass
                assert await process.wait() == 0
        finally:
            if process.returncode is None:
                process.kill()
                await process.wait()
    assert heard == [b"READY=1", b"WATCHDOG=1", b"WATCHDOG=1"]
    assert last == b"STOPPING=1"
