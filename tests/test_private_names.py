"""The product uses no private name of somebody else's package, but for what is listed here with its reason."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PRODUCT = ("client", "robot_bridge", "rtc", "server")
FILES = sorted(path for package in PRODUCT for path in (ROOT / package).rglob("*.py"))
# Documented all the same: of named tuples, and os._exit.
PUBLIC = {"_replace", "_asdict", "_fields", "_exit"}
BY_STRING = ("getattr", "setattr", "hasattr", "delattr")
MOST_LISTED = 5
# redis-py has no bound on what the server may make it read:
# tests/server/federation/redis/test_redis_private.py looks at it.
LISTED = {
    ("server/lockstep/server/federation/redis/redis_private.py", "_AsyncRESP2Parser"),
    ("server/lockstep/server/federation/redis/redis_private.py", "redis._parsers.resp2"),
}


def is_private(name: str) -> bool:
    return name.startswith("_") and not name.startswith("__") and name not in PUBLIC


def own_names(tree: ast.AST) -> set[str]:
    """What the file itself defines, or has on `self` and `cls`."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in ("self", "cls"):
            found.add(node.attr)
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            found.add(node.target.id)
    return found


def private_names(tree: ast.AST) -> Iterator[str]:
    own = own_names(tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and is_private(node.attr) and node.attr not in own:
            yield node.attr
        elif isinstance(node, ast.ImportFrom):
            yield from (each.name for each in node.names if is_private(each.name))
            if any(is_private(part) for part in (node.module or "").split(".")):
                yield node.module or ""
        elif isinstance(node, ast.Import):
            yield from (each.name for each in node.names if any(is_private(part) for part in each.name.split(".")))
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in BY_STRING:
            names = [each.value for each in node.args[1:2] if isinstance(each, ast.Constant)]
            yield from (name for name in names if isinstance(name, str) and name.startswith("_"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_file_uses_no_private_name_of_another_package(path: Path) -> None:
    where = str(path.relative_to(ROOT))
    found = {(where, name) for name in private_names(ast.parse(path.read_text()))}
    assert found <= LISTED


def test_what_is_listed_is_there_and_little() -> None:
    found = {
        (str(path.relative_to(ROOT)), name) for path in FILES for name in private_names(ast.parse(path.read_text()))
    }
    assert found == LISTED
    assert len(LISTED) <= MOST_LISTED


@pytest.mark.parametrize(
    "code",
    [
        "import thing\nthing._private()",
        "from thing import _private",
        "from thing._inner import name",
        "import thing._inner",
        "getattr(thing, '_private')",
        "setattr(thing, '_Class__name', 1)",
    ],
)
def test_every_way_to_a_private_name_is_found(code: str) -> None:
    assert list(private_names(ast.parse(code)))
