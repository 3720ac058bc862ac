import sys
from pathlib import Path

import pytest

from lockstep.bench.harness import lives
from lockstep.bench.harness.event_log import records
from lockstep.bench.harness.lives import BridgeLives, Lives
from tests.waiting import eventually


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lives, "DOWN_SECONDS", 0.0)


def _kinds(bridge: BridgeLives) -> list[str]:
    return [record["kind"] for record in records(bridge.event_log)] if bridge.event_log.exists() else []


async def test_a_process_lives_again_after_it_was_killed_with_what_it_is_told_then() -> None:
    script = "import os; print('{\"life\": %s}' % os.environ['LIFE'], flush=True); input()"
    process = Lives()
    assert await process.begin(sys.executable, "-c", script, LIFE="1") == {"life": 1}
    first = process.running
    assert first is not None
    await process.kill()
    assert first.process.returncode == -9
    assert await process.begin(sys.executable, "-c", script, LIFE="2") == {"life": 2}
    assert process.running is not first
    await process.end()


async def test_a_bridge_keeps_its_port_and_its_log_and_is_not_stopped_in_its_second_life(tmp_path: Path) -> None:
    bridge = BridgeLives(tmp_path)
    await bridge.begin()
    port = bridge.port
    await eventually(lambda: "start" in _kinds(bridge))  # a process that is killed writes no more
    await bridge.kill()
    await bridge.begin()
    assert bridge.address == f"tcp://127.0.0.1:{port}"
    await bridge.end()
    found = _kinds(bridge)
    assert found.count("start") == 2
    assert "stop" not in found
