"""No test touches the state that a console keeps for its user; all draw off screen.

Tests are `fast`, but for those of the files in slow.txt: real processes, networks and simulated robots, whose tests
take the better part of a second or more together. `make test-fast` leaves those and the browsers out.
"""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from robot_bridge.robots.mujoco_view.graphics import choose_graphics

choose_graphics()  # before a test file imports mujoco

settings.register_profile("any-machine", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any-machine")  # no test asserts a time


ROOT = Path(__file__).parents[1]
SLOW = {ROOT / line for line in (ROOT / "tests" / "slow.txt").read_text().split()}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.path not in SLOW and item.get_closest_marker("browser") is None:
            item.add_marker(pytest.mark.fast)


@pytest.fixture(autouse=True, scope="session")
def own_state_directory(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    before = os.environ.get("LOCKSTEP_STATE_DIR")
    os.environ["LOCKSTEP_STATE_DIR"] = str(tmp_path_factory.mktemp("state"))
    yield
    if before is None:
        del os.environ["LOCKSTEP_STATE_DIR"]
    else:
        os.environ["LOCKSTEP_STATE_DIR"] = before
