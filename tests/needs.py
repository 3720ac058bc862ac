"""What the tests of a file need, told from what the file imports.

A test is `fast` when its file imports nothing that starts a process, opens a connection or runs a physics engine,
itself or through a helper in `tests/`. One that computes for long says so: `pytest.mark.slow`.
"""

import sys
from functools import cache
from pathlib import Path
from types import ModuleType

__all__ = ["is_real"]

# Modules that start such a thing, each with all that is below it.
REAL = (
    "aioice",
    "aiortc",
    "lockstep.emulator.namespace.namespaces",
    "lockstep.emulator.network",
    "lockstep.emulator.namespace.network_process",
    "lockstep.bench.emulator_delay",
    "lockstep.bench.experiment.headless",
    "lockstep.bench.experiment.stage",
    "lockstep.bench.fleet_soak.run",
    "lockstep.bench.harness.caddy",
    "lockstep.bench.harness.lives",
    "lockstep.bench.harness.processes",
    "lockstep.bench.pick_place.hands",
    "lockstep.bench.pick_place.run",
    "lockstep.bench.quality.stage",
    "lockstep.bench.relay.stage",
    "lockstep.bench.robot_cuts.run",
    "lockstep.bench.harness.stack",
    "lockstep.bench.harness.tcp_path",
    "lockstep.client.console",
    "lockstep.client.transport.webrtc_transport",
    "httpx",
    "mujoco",
    "lockstep.robot_bridge.bridge",
    "lockstep.robot_bridge.link.link_client",
    "lockstep.robot_bridge.robots.micromanipulator",
    "lockstep.robot_bridge.robots.mjcf",
    "lockstep.robot_bridge.robots.mobile_manipulator",
    "lockstep.robot_bridge.robots.so101.model",
    "lockstep.robot_bridge.robots.so101.robot",
    "lockstep.server.cli.main",
    "lockstep.server.media.sources.reader",
    "lockstep.server.http.transport.serve",
    "subprocess",
    "tests.support",
    "typer.testing",
)
CALLS = ("create_subprocess_exec", "open_connection", "start_server")  # of asyncio, which everybody imports


@cache
def is_real(name: str) -> bool:
    """Whether the module of this name, which is imported, starts something."""
    if any(name == each or name.startswith(f"{each}.") for each in REAL):
        return True
    if not name.startswith("tests."):
        return False
    module = sys.modules[name]
    return _calls(module) or any(is_real(origin) for origin in _origins(module) - {name})


def _calls(module: ModuleType) -> bool:
    source = "" if module.__file__ is None else Path(module.__file__).read_text()
    return any(call in source for call in CALLS)


def _origins(module: ModuleType) -> set[str]:
    """Where the names of a module come from. Of a value without a module, as a number, nobody can tell."""
    values = vars(module).values()
    found = {each.__name__ if isinstance(each, ModuleType) else getattr(each, "__module__", None) for each in values}
    return {each for each in found if isinstance(each, str) and each in sys.modules}
