from dataclasses import replace

from lockstep.server.federation.messages import Published
from lockstep.server.federation.other_consoles import GONE_AFTER, MAX_CONSOLES, UNKNOWN_AFTER, OtherConsoles
from lockstep.server.federation.robot_summary import Tile
from tests.server.federation.boards import tile

OWN = "0" * 16


def shown(console: int, n: int, *robots: Tile) -> Published:
    return Published(id=f"{console:016x}", name=f"console-{console}", n=n, robots=robots)


def test_a_robot_is_shown_with_its_ages_grown_then_unknown_then_not_at_all() -> None:
    others = OtherConsoles(OWN, "own")
    assert others.heard(shown(1, 1, tile("left", feedback_age_ms=5.0, link_age_ms=1000.0, event_rate=9.0)), 100.0)
    (fresh,) = others.tiles([], 100.5)
    assert (fresh.link, fresh.feedback_age_ms, fresh.link_age_ms) == ("up", 505.0, 1500.0)
    assert fresh.console == "console-1"
    (silent,) = others.tiles([], 100.0 + UNKNOWN_AFTER + 0.5)
    assert (silent.link, silent.detail, silent.event_rate) == ("unknown", "its console is silent", 0.0)
    assert silent.link_age_ms == 3500.0, "how long it has been unknown"
    assert others.tiles([], 100.0 + GONE_AFTER) != []
    assert others.tiles([], 100.1 + GONE_AFTER) == []


def test_what_was_shown_before_is_no_sign_of_life() -> None:
    others = OtherConsoles(OWN, "own")
    others.heard(shown(1, 7, tile("left")), 100.0)
    assert not others.heard(shown(1, 7, tile("left")), 110.0)
    assert not others.heard(shown(1, 6, tile("left")), 110.0)
    assert others.tiles([], 110.0)[0].link == "unknown"
    assert others.heard(shown(1, 8, tile("left", event=3)), 111.0)
    assert (others.tiles([], 111.0)[0].link, others.tiles([], 111.0)[0].event) == ("up", 3)


def test_our_own_showing_is_nobody_else() -> None:
    others = OtherConsoles(OWN, "own")
    assert not others.heard(Published(id=OWN, name="own", n=1, robots=(tile("left"),)), 0.0)
    assert others.tiles([], 0.0) == []


def test_our_own_robots_are_not_shown_twice() -> None:
    others = OtherConsoles(OWN, "own")
    others.heard(shown(1, 1, tile("left"), tile("right")), 0.0)
    assert [each.name for each in others.tiles(["left"], 0.0)] == ["right"]


def test_a_conflict_takes_two_that_live_and_names_both() -> None:
    others = OtherConsoles(OWN, "own")
    others.heard(shown(1, 1, tile("left")), 0.0)
    assert others.conflicts(["left"], 0.0) == (), "it may be left over from a console that was started again"
    others.heard(shown(1, 2, tile("left")), 1.0)
    (conflict,) = others.conflicts(["left"], 1.0)
    assert (conflict.robot, conflict.consoles) == ("left", ("console-1", "own"))
    assert others.conflicts(["right"], 1.0) == ()
    assert others.conflicts(["left"], 1.1 + UNKNOWN_AFTER) == ()


def test_two_others_in_conflict_are_named_too_even_if_they_are_called_the_same_and_one_is_shown() -> None:
    others = OtherConsoles(OWN, "own")
    for n in (1, 2):
        others.heard(replace(shown(1, n, tile("far")), name="twin"), float(n))
        others.heard(replace(shown(2, n, tile("far")), name="twin"), float(n))
    (conflict,) = others.conflicts([], 2.0)
    assert conflict.consoles == ("twin", "twin")
    assert len(others.tiles([], 2.0)) == 1


def test_of_a_silent_and_a_living_console_the_living_ones_robot_is_shown() -> None:
    others = OtherConsoles(OWN, "own")
    others.heard(shown(1, 1, tile("far", event=1)), 0.0)
    others.heard(shown(2, 1, tile("far", event=2)), 10.0)
    (found,) = others.tiles([], 10.0)
    assert (found.console, found.event) == ("console-2", 2)
    assert others.owners(["far"], 10.0)["far"] in ("console-1", "console-2")


def test_who_says_goodbye_is_gone_at_once() -> None:
    others = OtherConsoles(OWN, "own")
    others.heard(shown(1, 1, tile("left")), 0.0)
    others.gone(f"{1:016x}")
    others.gone("unheard of")
    assert others.tiles([], 0.0) == []


def test_there_are_never_more_consoles_than_the_bound_and_the_dead_make_room() -> None:
    others = OtherConsoles(OWN, "own")
    for number in range(1, MAX_CONSOLES + 1):
        assert others.heard(shown(number, 1), 0.0)
    assert not others.heard(shown(99, 1), 0.0)
    assert others.heard(shown(99, 1), GONE_AFTER + 1)
