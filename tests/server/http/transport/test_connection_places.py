from collections import Counter

import pytest

from lockstep.server.http.transport.connection_places import GRACE, ConnectionPlaces, Place


class Rig:
    def __init__(self, total: int = 6, per_client: int = 4) -> None:
        self.refused: list[str] = []
        self.closed: list[str] = []
        self.places = ConnectionPlaces(total, per_client, self.refused.append)

    def enter(self, name: str, now: float = 0.0, *, proxy: bool = False) -> Place:
        """`name`: "a1" comes from the address "a"."""
        return self.places.enter(name[0], lambda: self.closed.append(name), now, proxy=proxy)


def test_there_are_never_more_than_fit_and_every_newcomer_gets_in() -> None:
    rig = Rig()
    for number in range(100):
        place = rig.enter(f"{'abc'[number % 3]}{number}")
        assert place.group is not None
        assert len(rig.places) <= 6
    assert len(rig.closed) == 94
    assert Counter(rig.refused) == {"too_many_connections": 94}


def test_an_address_loses_its_own_oldest_and_takes_nothing_from_others() -> None:
    rig = Rig(total=100, per_client=2)
    for name in ("a1", "b1", "a2", "a3", "a4"):
        rig.enter(name)
    assert rig.closed == ["a1", "a2"]


def test_when_all_is_full_the_address_that_has_most_loses_its_oldest() -> None:
    rig = Rig()
    for name in ("b1", "a1", "a2", "a3", "c1", "a4", "d1", "e1"):
        rig.enter(name)
    assert rig.closed == ["a1", "a2"]


def test_who_brought_a_good_token_stays_while_there_are_strangers() -> None:
    rig = Rig()
    for name in ("a1", "a2", "a3", "a4"):
        assert rig.places.serve(rig.enter(name), "a", f"link {name}")
    for number in range(20):
        rig.enter(f"b{number}")
    assert all(name.startswith("b") for name in rig.closed)
    assert rig.places.known == 4


def test_a_link_that_takes_everything_loses_its_oldest_to_a_newcomer() -> None:
    rig = Rig(per_client=6)
    for number in range(6):
        rig.places.serve(rig.enter(f"a{number}"), "a", "greedy")
    newcomer = rig.enter("b1")
    assert newcomer.group is not None
    assert rig.closed == ["a0"]


def test_behind_a_proxy_the_address_counts_that_it_forwards() -> None:
    rig = Rig(total=100, per_client=2)
    placed = [rig.enter(f"p{number}", proxy=True) for number in range(5)]
    assert rig.closed == []
    for place in placed[:4]:
        rig.places.serve(place, "attacker", "")
    assert rig.closed == ["p0", "p1"]
    assert rig.places.serve(placed[4], "somebody", "")
    assert not rig.places.serve(placed[0], "attacker", "link"), "what was taken away is not served"


def test_the_next_request_on_a_connection_has_to_prove_itself_anew() -> None:
    rig = Rig()
    place = rig.enter("a1")
    rig.places.serve(place, "a", "link")
    rig.places.serve(place, "b", "")
    assert (place.link, place.address, rig.places.known) == ("", "b", 0)
    rig.places.leave(place)
    rig.places.leave(place)
    assert len(rig.places) == 0


def test_a_newcomer_waits_while_who_would_have_to_go_may_still_say_what_he_comes_for() -> None:
    rig = Rig(total=2)
    assert rig.places.wait(5.0) == 0
    rig.enter("a1", 5.0)
    assert rig.places.wait(5.0) == 0
    rig.enter("a2", 5.1)
    assert rig.places.wait(5.1) == pytest.approx(GRACE - 0.1)
    assert rig.places.wait(5.0 + GRACE) == 0


def test_nobody_waits_for_a_stranger_who_has_asked_something() -> None:
    rig = Rig(total=2)
    first = rig.enter("a1", 5.0)
    rig.enter("a2", 5.0)
    rig.places.serve(first, "a", "")
    assert rig.places.wait(5.0) == 0
    rig.enter("a3", 5.0)
    assert rig.closed == ["a1"]
    assert rig.places.wait(5.0) == GRACE


def test_nobody_waits_where_all_have_brought_a_good_token() -> None:
    rig = Rig(total=2)
    for name in ("a1", "a2"):
        rig.places.serve(rig.enter(name, 5.0), "a", f"link {name}")
    assert rig.places.wait(5.0) == 0
