import os
import sys
from pathlib import Path

import pytest

from lockstep.server.robot import bridge_process
from lockstep.server.robot.bridge_process import BridgeFailed, BridgeProcess

ADDRESS = "tcp://127.0.0.1:4711"


def _bridge(directory: Path, prints: str) -> BridgeProcess:
    """One whose interpreter prints this, and stays."""
    python = directory / "python"
    python.write_text(f"#!{sys.executable}\nimport sys, time\n{prints}\nsys.stdout.flush()\ntime.sleep(600)\n")
    python.chmod(0o700)
    return BridgeProcess("planar", "127.0.0.1", 0, [], "secret", lambda _: None, str(python))


@pytest.mark.parametrize("first", ["a banner", '{"robot": 1}', "[]", "{" * 3000, "x" * 100_000, "\\xff"])
async def test_what_a_robots_library_prints_first_is_not_taken_for_its_address(tmp_path: Path, first: str) -> None:
    announcement = f'{{"robot": "{ADDRESS}"}}'
    bridge = _bridge(tmp_path, f"print({first!r})\nprint({announcement!r})")
    try:
        assert await bridge.start() == ADDRESS
    finally:
        await bridge.close()


async def test_a_bridge_that_prints_something_and_no_address_has_not_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bridge_process, "START_TIMEOUT", 0.5)
    bridge = _bridge(tmp_path, "print('no address')")
    with pytest.raises(BridgeFailed, match="did not start in time"):
        await bridge.start()


async def test_another_interpreter_finds_the_bridges_code_and_none_of_the_consoles_packages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those are of another version of Python, and would hide its own, such as those of a ROS installation."""
    monkeypatch.setenv("PYTHONPATH", "/its/own")
    said = tmp_path / "paths"
    tell = f"import os\nopen({str(said)!r}, 'w').write(os.environ['PYTHONPATH'])\nprint('{{\"robot\": \"{ADDRESS}\"}}')"
    bridge = _bridge(tmp_path, tell)
    await bridge.start()
    try:
        own, folder = said.read_text().split(":")
        assert own == "/its/own"
        assert os.listdir(folder) == ["lockstep"]
        assert sorted(os.listdir(f"{folder}/lockstep")) == ["protocol", "robot_bridge"]
        assert "__main__.py" in os.listdir(f"{folder}/lockstep/robot_bridge")
    finally:
        await bridge.close()
    with pytest.raises(FileNotFoundError):
        os.listdir(folder)


async def test_it_does_not_read_the_file_of_a_bridge_that_runs_by_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LOCKSTEP_ROBOT_CONFIG", "/etc/lockstep/robot.toml")
    said = tmp_path / "variables"
    tell = f"import os\nopen({str(said)!r}, 'w').write(' '.join(os.environ))\nprint('{{\"robot\": \"{ADDRESS}\"}}')"
    bridge = _bridge(tmp_path, tell)
    await bridge.start()
    await bridge.close()
    assert "LOCKSTEP_LINK_SECRET" in said.read_text().split()
    assert "LOCKSTEP_ROBOT_CONFIG" not in said.read_text().split()
