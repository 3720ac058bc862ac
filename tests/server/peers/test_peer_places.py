"""Who gets a place, over all roles and links."""

from contextlib import ExitStack
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.console import Role
from lockstep.server.auth.tokens import Identity
from lockstep.server.errors import ShuttingDown, TooManyPeers, TooManyRequests
from lockstep.server.peers.peer_places import RESERVED_FOR_LINK, PeerPlaces, check_place

BOUND, RESERVED = 20, 4


def _fill(role: Role, links: int, taken: int = 0, bound: int = BOUND, reserved: int = RESERVED) -> int:
    """Places that so many links of that role get together, each as many as it can."""
    begun = taken
    for _ in range(links):
        held = 0
        while True:
            try:
                check_place(role, held, taken, bound, reserved)
            except TooManyPeers:
                break
            held, taken = held + 1, taken + 1
    return taken - begun


def test_observers_get_all_places_but_the_last_ones_and_one_link_not_all_of_these() -> None:
    assert _fill("observer", 1) == 12
    assert _fill("observer", 5) == BOUND - RESERVED


def test_one_operators_link_cannot_eat_the_reserve_and_all_of_them_leave_a_supervisor_a_place() -> None:
    crowded = _fill("observer", 5)
    assert _fill("operator", 1, crowded) == RESERVED_FOR_LINK
    assert _fill("operator", 5, crowded) == RESERVED - 1
    assert _fill("supervisor", 1, crowded + RESERVED - 1) == 1


def test_one_supervisors_link_leaves_places_for_others_too() -> None:
    crowded = _fill("observer", 5)
    assert _fill("supervisor", 1, crowded) == RESERVED_FOR_LINK


@pytest.mark.parametrize("role", ["observer", "operator", "supervisor"])
def test_where_there_is_one_place_whoever_comes_first_gets_it(role: Role) -> None:
    assert _fill(role, 3, bound=1, reserved=0) == 1


@given(
    st.sampled_from(["observer", "operator", "supervisor"]),
    st.integers(1, 500),
    st.integers(0, 20),
    st.integers(0, 500),
)
def test_never_more_than_there_are(role: Role, bound: int, reserved: int, taken: int) -> None:
    try:
        check_place(role, 0, taken, bound, reserved)
    except TooManyPeers:
        return
    assert taken < bound


LIMITS: Any = SimpleNamespace(max_peers=4, max_relayed=8, reserved_places=1, max_unconnected=2, max_thumbnails=2)
ANN, BOB = (Identity("observer", name, name, 1e12) for name in ("ann", "bob"))


def _peer(identity: Identity, *, relay: str = "", connected: bool = True) -> Any:
    return SimpleNamespace(
        identity=identity, relay=relay, thumbnail=False, liveness=SimpleNamespace(connected=connected)
    )


def test_a_place_is_taken_by_peers_and_by_those_that_are_being_negotiated_but_not_by_those_of_a_relay() -> None:
    peers = [_peer(ANN), _peer(ANN, relay="0")]
    places = PeerPlaces(LIMITS, peers)
    with places.keep(ANN):
        assert (places.taken, places.taken_by("ann"), places.taken_by("bob")) == (2, 2, 0)
        with places.keep(BOB), pytest.raises(TooManyPeers), places.keep(BOB):
            raise AssertionError
    assert (places.taken, places.taken_by("ann")) == (1, 1)


def test_peers_of_a_link_that_have_not_connected_and_further_bounds_refuse_one_more() -> None:
    def full(identity: Identity) -> None:
        raise TooManyPeers("elsewhere")

    peers = [_peer(ANN, connected=False)]
    with ExitStack() as kept:
        places = PeerPlaces(LIMITS, peers)
        kept.enter_context(places.keep(ANN))
        with pytest.raises(TooManyRequests), places.keep(ANN):
            raise AssertionError
        kept.enter_context(places.keep(BOB))
    bounded = PeerPlaces(LIMITS, [], [full])
    with pytest.raises(TooManyPeers, match="elsewhere"), bounded.keep(ANN):
        raise AssertionError
    with bounded.keep(ANN, relayed=True):
        pass


def test_no_place_is_given_once_they_are_closed() -> None:
    places = PeerPlaces(LIMITS, [])
    places.close()
    with pytest.raises(ShuttingDown), places.keep(ANN):
        raise AssertionError
