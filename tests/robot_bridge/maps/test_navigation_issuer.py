"""When the map and the navigation are sent, on a clock that the test moves."""

import math

import pytest

from lockstep.protocol.maps import MAX_COORDINATE, MAX_PATH_POINTS, Navigation, OccupancyMap
from lockstep.protocol.messages import decode_message, encode_message
from lockstep.robot_bridge.maps.navigation_issuer import MAP_RATE, NavigationIssuer, shortened
from lockstep.robot_bridge.robots.navigation import GridMap, NavigationNow

HERE = NavigationNow(frame=(0.0, 0.0, 0.0))


def grid(time: float = 0.0) -> GridMap:
    return GridMap(1, 1, 0.1, (0.0, 0.0, 0.0), b"\0", time)


def packed(id: str, size: int = 10) -> OccupancyMap:
    return OccupancyMap(id=id, width=1, height=1, resolution=0.1, cells=bytes(size))


def look(issuer: NavigationIssuer, state: NavigationNow | None, now: float) -> Navigation | None:
    return issuer.look(state, now, 5)


def test_it_is_sent_at_once_then_once_a_second_and_sooner_for_news() -> None:
    issuer = NavigationIssuer()
    assert look(issuer, None, 0.0) is None
    assert look(issuer, HERE, 0.0) is not None
    assert look(issuer, HERE, 0.9) is None
    assert look(issuer, HERE, 1.0) is not None
    moved = NavigationNow(frame=(1.0, 0.0, 0.0))
    assert look(issuer, moved, 1.4) is None
    assert look(issuer, moved, 1.5) is not None
    going = moved._replace(goal=(1.0, 2.0, 3.0))
    assert look(issuer, going, 1.55) is None
    told = look(issuer, going, 1.6)
    assert told is not None
    assert told.goal == [1.0, 2.0, 3.0]


def test_a_map_that_is_new_is_sent_and_its_age_counts_from_the_robot() -> None:
    issuer, first = NavigationIssuer(), grid(time=2.0)
    assert not issuer.map_due(None, 3.0)
    assert issuer.map_due(first, 3.0)
    assert issuer.packed(first, packed("aa"), 3.0) is not None
    assert not issuer.map_due(first, 100.0)
    told = look(issuer, HERE, 5.0)
    assert told is not None
    assert (told.map, told.map_age) == ("aa", 3.0)
    same = grid(time=6.0)
    assert issuer.map_due(same, 6.0)
    assert issuer.packed(same, packed("aa"), 6.0) is None, "the same contents again are no news"
    told = look(issuer, HERE, 7.0)
    assert told is not None
    assert told.map_age == 1.0


def test_maps_that_come_too_fast_wait_and_large_ones_wait_longer() -> None:
    issuer = NavigationIssuer()
    issuer.packed(grid(), packed("aa", 20_000), 0.0)
    after = 20_000 / MAP_RATE
    assert not issuer.map_due(grid(), after - 0.1)
    assert issuer.map_due(grid(), after)


def test_what_is_not_finite_is_not_told() -> None:
    state = NavigationNow((math.nan, 0.0, 0.0), (0.0, math.inf, 0.0), [(0.0, math.nan)])
    told = look(NavigationIssuer(), state, 0.0)
    assert told is not None
    assert (told.located, told.goal, told.path) == (False, [], [])


def test_a_long_path_keeps_its_ends() -> None:
    path = [(float(number), 0.0) for number in range(10_000)]
    short = shortened(path)
    assert len(short) == MAX_PATH_POINTS
    assert (short[0], short[-1]) == (path[0], path[-1])
    assert shortened(path[:5]) == path[:5]


@pytest.mark.parametrize("far", [1.01 * MAX_COORDINATE, -math.inf, math.nan])
def test_a_place_that_the_message_does_not_take_is_not_known_and_leaves_no_older_one_standing(far: float) -> None:
    state = NavigationNow(frame=(far, 0.0, 0.0), goal=(0.0, far, 0.0), path=[(0.0, 0.0), (far, 1.0)])
    told = look(NavigationIssuer(), state, 1.0)
    assert told is not None
    assert (told.located, told.goal, told.path) == (False, [], [])
    assert decode_message(encode_message(told)) == told
