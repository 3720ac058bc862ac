from collections import Counter

from lockstep.bench.fleet_soak.driver import FleetDriver, Trip
from lockstep.bench.fleet_soak.verdict import MUST_BE_ZERO, Span, fleet_verdict, robot_verdict
from lockstep.bench.harness.event_log import Record

LIFE: list[Record] = [
    {"kind": "start"},
    {"kind": "feedback", "event": 1, "issue": 1, "time": 0.0, "at_rest": True},
    {"kind": "executed", "event": 2, "issue": 1, "time": 0.1, "values": [0.0]},
    {"kind": "feedback", "event": 2, "issue": 2, "time": 0.1, "at_rest": True},
    {"kind": "executed", "event": 3, "issue": 2, "time": 0.2, "values": [0.0]},
]


def _driver(name: str, *trips: Trip, **noticed: int) -> FleetDriver:
    driver = FleetDriver(name, "", 20, pictures=False)
    driver.trips += trips
    driver.noticed = Counter(noticed)
    return driver


def test_a_robot_that_nobody_disturbed_has_nothing_to_show() -> None:
    found = robot_verdict(_driver("a"), LIFE)
    assert (found["events"], found["lives"]) == (2, 1)
    assert not any(found[name] for name in MUST_BE_ZERO)


def test_what_a_driver_noticed_is_counted_by_its_kind() -> None:
    found = robot_verdict(_driver("a", no_seat=1, ConsoleLost=2, late=3), LIFE)
    assert (found["seats_lost"], found["connections_lost"], found["other_troubles"]) == (1, 2, 3)


def test_an_event_that_executed_twice_shows() -> None:
    found = robot_verdict(_driver("a"), [*LIFE, LIFE[-1]])
    assert (found["executed_twice"], found["events_skipped"]) == (1, 1)


def test_survivors_are_compared_with_the_calm() -> None:
    survivor = _driver("a", Trip(1.0, 0.010), Trip(11.0, 0.012), Trip(30.0, 9.0))
    killed = _driver("b", Trip(1.5, 0.010), Trip(11.0, 5.0))
    robots = {each.name: robot_verdict(each, LIFE) for each in (survivor, killed)}
    found = fleet_verdict([survivor, killed], robots, Span(0, 5, ""), [Span(10, 15, "b")])
    assert (found["calm"]["trips"], found["survivors_in_kills"]["trips"]) == (2, 1)
    assert found["survivors_ratio"] == 1.2
    assert found["events"] == 4


def test_without_a_kill_there_is_nothing_to_compare() -> None:
    driver = _driver("a", Trip(1.0, 0.010))
    assert fleet_verdict([driver], {"a": robot_verdict(driver, LIFE)}, Span(0, 5, ""), [])["survivors_ratio"] is None
