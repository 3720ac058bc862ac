"""Where a robot's latched stop is kept: with the robot, by whatever port it is reached."""

from pathlib import Path

import pytest

from lockstep.robot_bridge.stop.state_directory import default_place, older_places


@pytest.mark.parametrize("base", ["", "not/absolute"])
def test_by_default_it_has_the_robots_name_and_nothing_else_in_it(base: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/ada")
    monkeypatch.setenv("XDG_STATE_HOME", base)
    assert default_place("planar") == Path("/home/ada/.local/state/lockstep/stops/planar")
    monkeypatch.setenv("XDG_STATE_HOME", "/var/lib")
    assert default_place("planar") == Path("/var/lib/lockstep/stops/planar")


def test_older_places_of_the_robot_are_those_of_any_port(tmp_path: Path) -> None:
    for name in ("planar-5600", "planar-0", "crane-5600", "planar", "planar-two-5600", "mobile-manipulator-8000"):
        (tmp_path / "bridges" / name).mkdir(parents=True)
    (tmp_path / "bridges" / "planar-5601").touch()
    place = tmp_path / "stops" / "planar"
    assert [each.name for each in older_places(place, ("planar",))] == ["planar-0", "planar-5600"]
    described = older_places(tmp_path / "stops" / "crane", ("crane", "mobile-manipulator"))
    assert [each.name for each in described] == ["crane-5600", "mobile-manipulator-8000"]


def test_a_place_of_ones_own_has_no_older_ones(tmp_path: Path) -> None:
    (tmp_path / "bridges" / "planar-5600").mkdir(parents=True)
    assert older_places(tmp_path / "mine", ("planar",)) == ()
    assert older_places(tmp_path / "none" / "stops" / "planar", ("planar",)) == ()
