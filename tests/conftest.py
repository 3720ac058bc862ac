"""No test touches the state that a console keeps for its user; all draw off screen."""

import os
from collections.abc import Iterator

import pytest

from robot_bridge.robots.mujoco_view.graphics import choose_graphics

choose_graphics()  # before a test file imports mujoco


@pytest.fixture(autouse=True, scope="session")
def own_state_directory(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    before = os.environ.get("LOCKSTEP_STATE_DIR")
    os.environ["LOCKSTEP_STATE_DIR"] = str(tmp_path_factory.mktemp("state"))
    yield
    if before is None:
        del os.environ["LOCKSTEP_STATE_DIR"]
    else:
        os.environ["LOCKSTEP_STATE_DIR"] = before
