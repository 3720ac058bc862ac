"""No test touches the state that a console keeps for its user; all draw off screen.

What takes long runs first, files that need a browser between those that do not: these compute while the others wait.
Files whose tests share one console among all files are the last with browsers: it does not idle beside the others.
"""

import asyncio
import functools
import gc
import inspect
import itertools
import logging
import os
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import pytest
import structlog
from hypothesis import HealthCheck, settings

from lockstep.robot_bridge.robots.mujoco_view.graphics import choose_graphics
from tests.needs import is_real

# Until all tests are collected: what is made by then stays, and is not looked through again and again, which would hold
# up the robots that run in a test's process.
gc.disable()
choose_graphics()  # before a test file imports mujoco

settings.register_profile("any-machine", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any-machine")  # no test asserts a time

# As a console of its own process logs, see lockstep.server.telemetry.logs. What structlog does unless told otherwise
# draws each traceback with all its variables: that held robots in a test's process up for seconds.
structlog.configure(
    processors=[
        structlog.contextvars.merge_contextvars,
        structlog.processors.add_log_level,
        structlog.processors.format_exc_info,
        structlog.processors.KeyValueRenderer(key_order=["level", "event"]),
    ]
)


LIMIT = 0.9  # of the time of pytest-timeout, so that the test says where it waited
SLOW = ("slow", "browser", "long")
_homes = itertools.count()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        _bound(item)
        if not (is_real(_module(item)) or any(item.get_closest_marker(each) for each in SLOW)):
            item.add_marker(pytest.mark.fast)
    places = _places(items)
    items.sort(key=lambda item: places[item.path])


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """No garbage is collected while pytest parses the source of a failed test.

    A collection may log a traceback, as of a task that nobody awaited, and Python 3.11 parses source for that too. The
    parser is not reentrant there: it raises SystemError, which ends the whole run (pytest issue 10763).
    """
    collecting = gc.isenabled()
    gc.disable()
    try:
        return (yield)
    finally:
        if collecting:
            gc.enable()


def pytest_collection_finish() -> None:
    gc.freeze()
    gc.enable()


def _bound(item: pytest.Item) -> None:
    """End in time what a test awaits. pytest-timeout raises in a signal handler; asyncio only logs what is raised while
    it runs a callback, and the test would wait for ever."""
    assert isinstance(item, pytest.Function)
    test = item.obj
    if not inspect.iscoroutinefunction(test):
        return
    marker = item.get_closest_marker("timeout")
    seconds = float(marker.args[0] if marker is not None else item.config.getini("timeout"))

    @functools.wraps(test)
    async def bounded(*args: Any, **kwargs: Any) -> None:
        async with asyncio.timeout(LIMIT * seconds):
            await test(*args, **kwargs)

    item.obj = bounded


def _module(item: pytest.Item) -> str:
    assert isinstance(item, pytest.Function)
    name: str = item.module.__name__
    return name


def _places(items: list[pytest.Item]) -> dict[Path, float]:
    """Of each file in the run: those with browsers and other slow ones evenly from 0 to 1, then the rest."""
    kinds: dict[str, dict[Path, None]] = {"browser": {}, "slow": {}, "fast": {}}
    for item in sorted(items, key=_console_shared):
        kind = next((each for each in ("browser", "fast") if item.get_closest_marker(each)), "slow")
        kinds[kind].pop(item.path, None)
        kinds[kind][item.path] = None
    places = dict.fromkeys(kinds["fast"], 1.0)
    for each in ("slow", "browser"):
        places |= {path: (number + 0.5) / len(kinds[each]) for number, path in enumerate(kinds[each])}
    return places


def _console_shared(item: pytest.Item) -> int:
    """Files that share one are neighbours: 0 for none, and one for each kind of it."""
    assert isinstance(item, pytest.Function)
    if "stack_keeper" not in item.fixturenames:
        return 0
    return 1 if item.get_closest_marker("full_rate") else 2


@pytest.fixture(autouse=True, scope="session")
def own_state_directory(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("LOCKSTEP_STATE_DIR", str(tmp_path_factory.mktemp("state")))
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state-home")))  # of bridges
        yield


@pytest.fixture(autouse=True)
def logs_as_before() -> Iterator[None]:
    """A command that a test runs in this process configures logs for its standard error, which pytest then closes."""
    before, handlers = structlog.get_config(), logging.root.handlers[:]
    yield
    structlog.configure(**before)
    for handler in logging.root.handlers[:]:
        if handler not in handlers and type(handler) is logging.StreamHandler:
            logging.root.removeHandler(handler)


@pytest.fixture(autouse=True)
def own_state_home(own_state_directory: None) -> Iterator[None]:
    """A bridge that was killed begins stopped the next time: the next test's has another place for its stop."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(Path(os.environ["XDG_STATE_HOME"]) / str(next(_homes))))
        yield
