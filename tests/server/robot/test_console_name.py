"""What consoles call themselves at a bridge."""

from pathlib import Path

from lockstep.server.robot.console_name import console_name


def test_a_console_keeps_its_name_and_another_has_another(tmp_path: Path) -> None:
    assert console_name(tmp_path / "a") == console_name(tmp_path / "a")
    assert console_name(tmp_path / "a") != console_name(tmp_path / "b")
    assert console_name(None) == console_name(None)
    assert str(tmp_path) not in console_name(tmp_path)
