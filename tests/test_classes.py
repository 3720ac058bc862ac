"""A class with more than fifteen methods is two things, unless this list says why it is one."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PARTS = ("protocol", "rtc", "robot_bridge", "client", "server", "bench")
MOST = 15

ROBOTS = "robot_bridge/lockstep/robot_bridge/robots"
# Classes that are one thing all the same: path and name, number, reason.
ALLOWED = {
    # what users call: each method is a documented verb or property
    "client/lockstep/client/console.py Console": 45,
    # what authors of robots implement, and the robots that do
    f"{ROBOTS}/base.py Robot": 22,
    f"{ROBOTS}/lerobot/robot.py LeRobotRobot": 19,
    f"{ROBOTS}/micromanipulator/robot.py Micromanipulator": 20,
    f"{ROBOTS}/mjcf/robot.py MjcfRobot": 22,
    f"{ROBOTS}/mobile_manipulator/robot.py MobileManipulator": 21,
    f"{ROBOTS}/planar/robot.py PlanarRobot": 18,
    f"{ROBOTS}/ros2/robot.py Ros2Robot": 22,
    f"{ROBOTS}/so101/robot.py So101": 21,
    # what server and client call: each method is one of the peer's, with the clock and a flush
    "rtc/lockstep/rtc/sockets/connection.py Connection": 32,
    # joins the cores for each datagram: a further part would cost a call for each packet
    "rtc/lockstep/rtc/peer.py Peer": 23,
    # a session as the console sees it: what others call or report, each with the peer's own faults contained
    "server/lockstep/server/peers/peer.py Peer": 18,
    # sixteen are the interface that uvicorn calls; the others run for each frame
    "server/lockstep/server/http/transport/uvicorn_websocket_limits.py BoundedWebSocket": 24,
}


def large_classes(source: str) -> Iterator[tuple[str, int]]:
    """Yield the name of each class with more than `MOST` methods, and their number."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ClassDef):
            names = [
                method.name
                for method in node.body
                if isinstance(method, ast.FunctionDef | ast.AsyncFunctionDef) and not is_overload(method)
            ]
            if len(names) > MOST:
                yield node.name, len(names)


def is_overload(method: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Say whether this is a signature for the type checker only."""
    return any(ast.unparse(decorator).endswith("overload") for decorator in method.decorator_list)


def test_no_class_of_the_product_has_more_than_fifteen_methods_but_those_in_the_list() -> None:
    found = {
        f"{path.relative_to(ROOT).as_posix()} {name}": number
        for part in PARTS
        for path in (ROOT / part / "lockstep").rglob("*.py")
        for name, number in large_classes(path.read_text())
    }
    assert found == ALLOWED


@pytest.mark.parametrize(("methods", "found"), [(15, []), (16, [("A", 16)])])
def test_methods_of_a_class_are_counted(methods: int, found: list[tuple[str, int]]) -> None:
    source = "class A:\n" + "".join(f"    def m{number}(self): ...\n" for number in range(methods))
    assert list(large_classes(source)) == found


def test_a_signature_for_the_type_checker_is_no_method() -> None:
    signatures = "    @overload\n    def get(self, key: int) -> int: ...\n" * 2
    source = "class A:\n" + "".join(f"    def m{number}(self): ...\n" for number in range(15)) + signatures
    assert list(large_classes(source)) == []
