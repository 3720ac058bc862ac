from pathlib import Path

import pytest

from lockstep.server.fleet.simulated import own_event_log, simulated_robots
from lockstep.server.util.robot_names import BadFleet


def test_one_robot_without_a_name_is_the_only_one() -> None:
    assert simulated_robots(["planar"]) == {"": "planar"}


def test_one_robot_with_a_name_is_a_fleet_of_one() -> None:
    assert simulated_robots(["left=planar"]) == {"left": "planar"}


def test_several_are_called_what_they_are_and_numbered() -> None:
    given = ["planar", "mobile-manipulator", "planar", "planar-3=planar", "planar"]
    assert simulated_robots(given) == {
        "planar": "planar",
        "mobile-manipulator": "mobile-manipulator",
        "planar-2": "planar",
        "planar-3": "planar",
        "planar-4": "planar",
    }


@pytest.mark.parametrize(
    ("given", "name"), [(["a=planar", "a=planar"], "robot_named_twice"), (["A=planar"], "bad_robot_name")]
)
def test_bad_names_are_refused(given: list[str], name: str) -> None:
    with pytest.raises(BadFleet) as refused:
        simulated_robots(given)
    assert refused.value.name == name


def test_each_bridge_writes_an_event_log_of_its_own() -> None:
    assert own_event_log(Path("d/events.jsonl"), "") == Path("d/events.jsonl")
    assert own_event_log(Path("d/events.jsonl"), "left") == Path("d/events-left.jsonl")
