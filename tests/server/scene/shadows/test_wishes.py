from typing import Literal

import pytest

from lockstep.protocol.console import ShadowVerdict
from lockstep.server.scene.shadows.wishes import ShadowWishes

Judgement = Literal["in_time", "out_of_limits", "late", "unseen", "wrong_size", "not_a_number"]


def verdict(peer: str, event: int, judgement: Judgement = "in_time") -> ShadowVerdict:
    return ShadowVerdict(peer=peer, name=f"policy {peer}", event=event, values=[1.0], judgement=judgement)


def test_the_newest_wish_of_each_policy_counts() -> None:
    wishes = ShadowWishes()
    for event in (7, 8):
        wishes.take(verdict("a", event), 1.0)
    wishes.take(verdict("b", 8, "out_of_limits"), 1.0)
    assert [(each.peer, each.event) for each in wishes.of_now(9, 1.5)] == [("a", 8), ("b", 8)]


@pytest.mark.parametrize("judgement", ["late", "unseen", "wrong_size", "not_a_number"])
def test_what_could_not_be_compared_is_no_wish(judgement: Judgement) -> None:
    wishes = ShadowWishes()
    wishes.take(verdict("a", 8, judgement), 1.0)
    assert wishes.of_now(8, 1.0) == []


def test_an_old_wish_is_forgotten_by_events_and_by_time_also_where_the_reference_wraps() -> None:
    wishes = ShadowWishes()
    wishes.take(verdict("a", 2**31 - 1), 1.0)
    assert wishes.of_now(10, 2.9) != []
    assert wishes.of_now(40, 2.9) == []
    assert wishes.of_now(10, 3.1) == []
    assert wishes.of_now(10, 2.9) == [], "forgotten"


def test_a_crowd_of_policies_leaves_the_newest() -> None:
    wishes = ShadowWishes()
    for number in range(20):
        wishes.take(verdict(str(number), 5), float(number) / 100)
    assert [each.peer for each in wishes.of_now(5, 0.2)] == [str(number) for number in range(12, 20)]
