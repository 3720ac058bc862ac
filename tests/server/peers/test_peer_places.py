import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.console import Role
from lockstep.server.errors import TooManyPeers
from lockstep.server.peers.peer_places import RESERVED_FOR_LINK, check_place

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
