"""Minutes of the day, as its user runs them."""

import asyncio
import json
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.browser, pytest.mark.long, pytest.mark.timeout(900)]


async def test_two_runs_add_up_and_break_nothing(tmp_path: Path) -> None:
    file = tmp_path / "day.json"
    for count in (1, 2):
        process = await asyncio.create_subprocess_exec(
            *(str(Path(sys.executable).with_name("lockstep")), "soak-day", str(file), "--minutes", "3"),
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
        )
        out, said = await process.communicate()
        assert process.returncode == 0, said.decode()[-3000:]
        found = json.loads(out)
        assert found["runs"] == count
        assert found["verdicts"]["nothing_broken"]
        assert set(found["pictures_by_relay"]) >= {"the console", "0", "1"}
        assert all(shown > 0 for shown in found["pictures_by_page"].values()), found["pictures_by_page"]
        assert found["executed"] > 20 * count
