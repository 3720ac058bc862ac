"""Opens pages behind an emulated network with the kernel's own TCP, in two network namespaces; for root only."""

import asyncio
import json
import subprocess
import sys
import tempfile
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from lockstep.emulator.impairment.profile import Profile
from lockstep.emulator.namespace.namespaces import ROBOT_ADDRESS, Namespaces

__all__ = ["far_baseline", "far_console", "open_far"]

READY_SECONDS = 60.0
OPENING_SECONDS = 120.0


@asynccontextmanager
async def far_console(profile: Profile | str, robot: str) -> AsyncIterator[tuple[Namespaces, str]]:
    """Start a console and its robot on the far side; yield the network and the operator's link.

    Raises:
        NamespacesUnavailable: names the missing part.
    """
    lockstep = str(Path(sys.executable).with_name("lockstep"))
    with tempfile.TemporaryDirectory() as state:
        command = (lockstep, "up", "--robot", robot, "--host", ROBOT_ADDRESS, "--port", "8000", "--json", "--quiet")
        async with Namespaces(profile) as network:
            ready = await _started(network, (*command, "--state-dir", state))
            yield network, ready["operator"]


@asynccontextmanager
async def far_baseline(profile: Profile | str, robot: str) -> AsyncIterator[tuple[Namespaces, str]]:
    """Serve the same pictures from plain aiortc; yield the network and the link of a bare page."""
    with tempfile.TemporaryDirectory() as state:
        bridge = (sys.executable, "-m", "lockstep.robot_bridge", robot, "--port", "0", "--json", "--state-dir", state)
        async with Namespaces(profile) as network:
            # Both are in one network; the link between them does not pass the emulated path.
            found = await _started(network, bridge)
            server = (sys.executable, "-m", "lockstep.bench.baseline.baseline_server", found["robot"], ROBOT_ADDRESS)
            yield network, (await _started(network, server))["console"]


async def open_far(network: Namespaces, link: str, expression: str, count: int) -> list[dict[str, Any]]:
    """Run `lockstep.bench.page_opening.openings` on the operator's side, and return its results."""
    command = (sys.executable, "-m", "lockstep.bench.page_opening.openings", link, expression, str(count))
    process = await network.start("operator", command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE)
    assert process.stdout is not None
    async with asyncio.timeout(OPENING_SECONDS * count):
        lines = (await process.stdout.read()).splitlines()
    return [json.loads(line) for line in lines]


async def _started(network: Namespaces, command: Sequence[str]) -> dict[str, Any]:
    process = await network.start("robot", command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE)
    assert process.stdout is not None
    async with asyncio.timeout(READY_SECONDS):
        ready: dict[str, Any] = json.loads(await process.stdout.readline())
    return ready
