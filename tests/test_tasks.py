"""Every task belongs to a TaskGroup, so that it ends before its owner does and its failure is noticed.

A task outside of a group is bare. Each bare task of the product is listed here with the reason for it.
"""

import ast
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PARTS = ("protocol", "rtc", "robot_bridge", "client", "server", "bench")
MAKERS = {"create_task", "ensure_future"}

# Tasks that a TaskGroup cannot hold: file, number, reason.
ALLOWED = {
    "robot_bridge/lockstep/robot_bridge/bridge.py": 1,  # ticks go on while the caller is cancelled, until `close`
    "robot_bridge/lockstep/robot_bridge/stop/stop_keeper.py": 1,  # writes stops while the bridge's other tasks fail
    "client/lockstep/client/connection.py": 1,  # its end must not cancel the user's program, whose waits raise it
    "client/lockstep/client/shielded_close.py": 1,  # survives the cancellation of its caller
    "rtc/lockstep/rtc/sockets/tcp_port.py": 1,  # made by a callback of the loop; `close` cancels it
    "server/lockstep/server/util/uncancelled.py": 3,  # survive the cancellation of their caller, or count their own
}


def bare_tasks(source: str) -> Iterator[int]:
    """Yield the line of each call that makes a task on anything but a TaskGroup."""
    tree = ast.parse(source)
    groups = set(task_groups(tree))
    for node in ast.walk(tree):
        match node:
            case ast.Call(func=ast.Name(id=name)) if name in MAKERS:
                yield node.lineno
            case ast.Call(func=ast.Attribute(value=owner, attr=name)) if name in MAKERS:
                if ast.unparse(owner) not in groups:
                    yield node.lineno
            case _:
                pass


def task_groups(tree: ast.Module) -> Iterator[str]:
    """Yield the names under which this file has TaskGroups: opened, or annotated as such."""
    for node in ast.walk(tree):
        match node:
            case ast.withitem(context_expr=ast.Call(func=made), optional_vars=ast.expr() as name):
                if ast.unparse(made) in ("asyncio.TaskGroup", "TaskGroup"):
                    yield ast.unparse(name)
            case ast.arg(arg=name, annotation=ast.expr() as kind) if "TaskGroup" in ast.unparse(kind):
                yield name
            case ast.AnnAssign(target=target, annotation=kind) if "TaskGroup" in ast.unparse(kind):
                yield ast.unparse(target)
            case _:
                pass


def test_no_task_of_the_product_is_bare_but_those_in_the_list() -> None:
    found = Counter[str]()
    for part in PARTS:
        for path in (ROOT / part / "lockstep").rglob("*.py"):
            found[path.relative_to(ROOT).as_posix()] += len(list(bare_tasks(path.read_text())))
    assert {name: found[name] for name in ALLOWED} == ALLOWED
    assert found == Counter(ALLOWED)


@pytest.mark.parametrize(
    "source",
    [
        "asyncio.create_task(work())",
        "asyncio.ensure_future(work())",
        "create_task(work())",
        "loop.create_task(work())",
        "self._loop.create_task(work())",
        "asyncio.get_running_loop().create_task(work())",
        "async def run(loop):\n    async with asyncio.timeout(1) as loop:\n        loop.create_task(work())",
    ],
)
def test_a_task_outside_of_a_group_is_found(source: str) -> None:
    assert len(list(bare_tasks(source))) == 1


@pytest.mark.parametrize(
    "source",
    [
        "async def run():\n    async with asyncio.TaskGroup() as tasks:\n        tasks.create_task(work())",
        "def begin(tasks: asyncio.TaskGroup):\n    tasks.create_task(work())",
        "class Owner:\n    def __init__(self):\n        self._tasks: asyncio.TaskGroup | None = None\n"
        "    def begin(self):\n        self._tasks.create_task(work())",
    ],
)
def test_a_task_of_a_group_is_not_bare(source: str) -> None:
    assert list(bare_tasks(source)) == []
