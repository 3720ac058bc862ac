"""The SO-101 for tests with a page: `lockstep up --robot so101`, with the model that `make test` fetched."""

from pathlib import Path
from typing import Final

import pytest

from lockstep.robot_bridge.robots.so101.model_source import FOLDER_VARIABLE

__all__ = ["SO101", "needs_so101"]

FOLDER: Final = Path(__file__).parents[2] / ".so101"
SO101: Final = {FOLDER_VARIABLE: str(FOLDER)}  # of the environment

needs_so101 = pytest.mark.skipif(
    not (FOLDER / ".installed").is_file(), reason="the model of the SO-101 is not here; `make test` fetches it"
)
