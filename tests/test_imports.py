"""What may import what: parts of the repository, the console's folders, and no files in a circle."""

import ast
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PARTS = {
    "protocol": set[str](),
    "rtc": set[str](),
    "robot_bridge": {"protocol"},
    "client": {"protocol", "rtc"},
    "server": {"protocol", "rtc", "robot_bridge"},
    "emulator": {"protocol", "server"},  # it lies beside the measurements, in `bench/`
    "bench": {"protocol", "rtc", "robot_bridge", "client", "server", "emulator"},
}
# Of the bridge the console has the link's client, the commands, what a bridge beside it says when it cannot start, and
# how a process reports to its service manager.
FROM_THE_BRIDGE = {
    *("link", "cli", "conformance", "description", "encoding", "errors", "robots", "service_manager", "stop"),
    "watchdog",
}
# The console's folders and files, from the bottom to the top: each imports those before it.
LAYERS = (
    "errors", "event_clock", "util", "telemetry", "evidence", "audit", "stop", "session_events", "webrtc", "media",
    "talkback", "auth", "http", "peers", "sfu", "robot", "actions", "federation", "publishing", "scene",
    "settings_file", "settings", "control", "recording",
    "foxglove", "rerun", "state", "routes", "composition", "fleet", "cli",
)  # fmt: skip


@cache
def modules() -> dict[str, Path]:
    found = {}
    for part in PARTS:
        for path in (ROOT / part / "lockstep").rglob("*.py"):
            name = ".".join(path.relative_to(ROOT / part).with_suffix("").parts)
            found[name.removesuffix(".__init__")] = path
    return found


def imports(path: Path) -> Iterator[str]:
    """What is imported as the module is, and not later or for its types alone."""
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.ImportFrom) and node.module is not None:
            for each in node.names:
                inner = f"{node.module}.{each.name}"
                yield inner if inner in modules() else node.module
        elif isinstance(node, ast.Import):
            yield from (each.name for each in node.names)


@cache
def edges() -> dict[str, set[str]]:
    return {name: set(imports(path)) & modules().keys() for name, path in modules().items()}


def part(module: str) -> str:
    return module.split(".")[1]


def layer(module: str) -> int:
    return LAYERS.index(module.split(".")[2])


def is_settings(module: str) -> bool:
    """Settings of all parts are put together in one place, and read in many."""
    return module.rpartition(".")[2].endswith("settings")


@pytest.mark.parametrize("name", PARTS)
def test_a_part_imports_only_the_parts_that_it_may(name: str) -> None:
    assert len([module for module in modules() if part(module) == name]) > 5
    allowed = PARTS[name] | {name}
    wrong = {
        f"{module} imports {other}"
        for module, others in edges().items()
        for other in others
        if part(module) == name and part(other) not in allowed
    }
    assert wrong == set()


def test_the_console_knows_of_the_bridge_only_its_link_and_its_commands() -> None:
    used = {
        other
        for module, others in edges().items()
        for other in others
        if part(module) == "server" and part(other) == "robot_bridge" and other != "lockstep.robot_bridge"
    }
    assert used
    assert {other for other in used if other.split(".")[2] not in FROM_THE_BRIDGE} == set()


def test_no_files_import_each_other_in_a_circle() -> None:
    try:
        TopologicalSorter(edges()).prepare()
    except CycleError as error:
        pytest.fail(" → ".join(error.args[1]))


def test_every_folder_of_the_console_has_its_layer() -> None:
    found = {module.split(".")[2] for module in modules() if part(module) == "server" and module.count(".") > 1}
    assert found == set(LAYERS)


def test_the_consoles_folders_import_only_those_below() -> None:
    wrong = {
        f"{module} imports {other}"
        for module, others in edges().items()
        for other in others
        if part(module) == part(other) == "server"
        and min(module.count("."), other.count(".")) > 1
        and layer(module) < layer(other)
        and not is_settings(module)
        and not is_settings(other)
    }
    assert wrong == set()
