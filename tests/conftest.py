"""No test touches the state that a console keeps for its user."""

import os
from collections.abc import Iterator

import pytest


@pytest.fixture(autouse=True, scope="session")
def own_state_directory(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    before = os.environ.get("LOCKSTEP_STATE_DIR")
    os.environ["LOCKSTEP_STATE_DIR"] = str(tmp_path_factory.mktemp("state"))
    yield
    if before is None:
        del os.environ["LOCKSTEP_STATE_DIR"]
    else:
        os.environ["LOCKSTEP_STATE_DIR"] = before
