"""What `rtc/` may not have, read from its syntax trees."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FILES = sorted((ROOT / "rtc").rglob("*.py"))
FOREIGN = {"server", "client", "robot_bridge", "bench", "aiortc", "aioice"}
SHELLS = {
    *("address_servers.py", "connection.py", "endpoint.py", "event_delivery.py", "interfaces.py"),
    *("core_timer.py", "port_sockets.py", "turn_client.py", "tcp_port.py", "udp_socket.py"),
}
NOT_IN_CORES = {"asyncio", "socket", "time", "threading"}


def imported(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (each.name.partition(".")[0] for each in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield (node.module or "").partition(".")[0]


def private_names(tree: ast.AST) -> Iterator[str]:
    """Of anything but `self` and `cls`, and of what the same file defines."""
    own = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute) and is_own(node)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and node.attr.startswith("_") and not node.attr.startswith("__"):
            if not is_own(node) and node.attr not in own:
                yield node.attr
        elif isinstance(node, ast.ImportFrom):
            yield from (each.name for each in node.names if each.name.startswith("_"))


def is_own(node: ast.Attribute) -> bool:
    return isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_file_is_of_no_other_package_and_uses_no_private_names(path: Path) -> None:
    tree = ast.parse(path.read_text())
    assert set(imported(tree)) & FOREIGN == set()
    assert list(private_names(tree)) == []
    if path.name not in SHELLS:
        assert set(imported(tree)) & NOT_IN_CORES == set()
