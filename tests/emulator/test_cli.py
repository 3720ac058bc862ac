"""The command as its user runs it."""

import asyncio
import json
import signal
import subprocess
import sys
from pathlib import Path

import httpx
import pytest
import typer
from typer.testing import CliRunner

from lockstep.emulator.cli import network_command
from lockstep.emulator.errors import NamespacesUnavailable
from lockstep.emulator.namespace.tun import open_tun

COMMAND = [str(Path(sys.executable).with_name("lockstep")), "network"]
PIPE = asyncio.subprocess.PIPE


async def test_it_prints_where_to_go_obeys_and_ends_on_a_signal() -> None:
    process = await asyncio.create_subprocess_exec(
        *COMMAND,
        *("perfect", "--console", "http://127.0.0.1:1/#token=x", "--robot", "tcp://127.0.0.1:2", "--json"),
        stdin=PIPE,
        stdout=PIPE,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    async with asyncio.timeout(40):
        addresses = json.loads(await process.stdout.readline())
        assert addresses["console"].endswith("/#token=x")
        assert addresses["robot"].startswith("tcp://127.0.0.1:")
        async with httpx.AsyncClient(trust_env=False) as browser:
            assert (await browser.get(addresses["console"])).status_code == 502
        process.stdin.write(b"hold 0.01\nstatistics\n")
        counts = json.loads(await process.stdout.readline())
        assert counts["paths"]["signalling"]["to_robot"]["offered"] == 1
        process.send_signal(signal.SIGINT)
        assert await process.wait() == 0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("nowhere", "--console", "http://127.0.0.1:1"), "there is no such profile; use bursty-loss"),
        (("perfect",), "give --console URL"),
        (("perfect", "--robot", "somewhere"), "tcp://host:port"),
        (("perfect", "--namespaces"), "--robot-side"),
    ],
)
def test_what_cannot_work_is_said_and_ends_with_2(arguments: tuple[str, ...], said: str) -> None:
    app = typer.Typer()
    app.command()(network_command)
    ended = CliRunner().invoke(app, arguments)
    assert ended.exit_code == 2
    assert said in " ".join(ended.output.split())


def test_with_namespaces_it_ends_as_the_operators_command_does() -> None:
    try:
        open_tun("198.18.0.1").close()
    except NamespacesUnavailable as reason:
        pytest.skip(str(reason))
    sides = ["--robot-side", "sleep 60", "--operator-side", "sh -c 'exit 7'"]
    command = [*COMMAND, "perfect", "--namespaces", *sides, "--json"]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=40, stdin=subprocess.DEVNULL)
    assert ended.returncode == 7
    assert "paths" in json.loads(ended.stdout)
    assert "nsenter" in ended.stderr
