"""The robots that wait, as people are told of them."""

from hypothesis import given
from hypothesis import strategies as st

from lockstep.server.robot.waiting_robots import FORGOTTEN_AFTER, MAX_WAITING, WaitingRobot, WaitingRobots
from lockstep.server.util.display_names import MAX_NAME

ADDRESSES = st.integers(0, 30).map(lambda n: f"10.0.0.{n}")
TRIES = st.lists(st.tuples(ADDRESSES, st.floats(0.0, 90.0), st.text(max_size=80)), max_size=80)
WALL = 1_700_000_000.0


@given(TRIES, st.floats(0.0, 90.0))
def test_those_of_the_last_minute_are_known_the_newest_eight_each_once(
    tries: list[tuple[str, float, str]], later: float
) -> None:
    robots, now = WaitingRobots(), 0.0
    newest: dict[str, float] = {}
    first: dict[str, float] = {}  # of the tries of this wait
    for address, passed, name in tries:
        now += passed
        kept = [each.address for each in robots.waiting(now)]
        if address not in kept:
            first[address] = WALL + now
        robots.called(address, "robot_unknown", name, now, WALL + now)
        newest.pop(address, None)
        newest[address] = now
    now += later
    expected = {each for each in list(newest)[-MAX_WAITING:] if now - newest[each] <= FORGOTTEN_AFTER}
    found = robots.waiting(now)
    assert {each.address for each in found} == expected
    assert len(found) == len(expected)
    assert [each.since for each in found] == sorted(first[each.address] for each in found)


@given(st.text(max_size=200))
def test_a_name_that_a_stranger_gives_is_short_and_has_no_control_characters(name: str) -> None:
    robots = WaitingRobots()
    robots.called("10.0.0.7", "wrong_code", name, 0.0, WALL)
    (found,) = robots.waiting(0.0)
    assert len(found.name) <= MAX_NAME
    assert found.name.isprintable()


def test_a_robot_keeps_its_first_time_and_its_name_and_has_the_reason_of_its_newest_try() -> None:
    robots = WaitingRobots()
    robots.called("10.0.0.7", "wrong_code", "planar\n\x1b[2J", 0.0, WALL)
    robots.called("10.0.0.7", "robot_unknown", "", 5.0, WALL + 5.0)
    assert robots.waiting(6.0) == [WaitingRobot("10.0.0.7", WALL, "planar [2J", "robot_unknown")]
    robots.called("10.0.0.7", "wrong_code", "dual-arm", 7.0, WALL + 7.0)
    assert robots.waiting(8.0) == [WaitingRobot("10.0.0.7", WALL, "dual-arm", "wrong_code")]
    robots.called("10.0.0.7", "not_pairing", "\n", 9.0, WALL + 9.0)
    assert robots.waiting(9.0) == [WaitingRobot("10.0.0.7", WALL, "dual-arm", "not_pairing")]
    later = 10.0 + FORGOTTEN_AFTER
    robots.called("10.0.0.7", "not_pairing", "", later, WALL + later)
    assert [each.name for each in robots.waiting(later)] == [""], "a name is forgotten with its robot"


def test_a_robot_that_is_let_in_waits_no_more() -> None:
    robots = WaitingRobots()
    for address in ("10.0.0.7", "10.0.0.8"):
        robots.called(address, "taken", "planar", 0.0, WALL)
    robots.admitted("10.0.0.7")
    robots.admitted("10.0.0.9")
    assert [each.address for each in robots.waiting(1.0)] == ["10.0.0.8"]


def test_no_stranger_hides_that_a_robot_with_the_paired_robots_key_waits() -> None:
    robots = WaitingRobots()
    robots.called("10.0.0.7", "taken", "", 0.0, WALL)
    for number in range(2 * MAX_WAITING):
        robots.called(f"10.0.0.{number}", "robot_unknown", "", 1.0, WALL + 1.0)
    found = robots.waiting(1.0)
    assert len(found) == MAX_WAITING + 1
    assert found[0] == WaitingRobot("10.0.0.7", WALL, "", "taken")


def test_a_name_ends_no_quotation() -> None:
    robots = WaitingRobots()
    robots.called("10.0.0.7", "wrong_code", '” waits at 10.0.0.9: it is "paired". “', 0.0, WALL)
    (found,) = robots.waiting(0.0)
    assert found.name == "waits at 10.0.0.9: it is paired."
