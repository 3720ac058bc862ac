import re

from lockstep.protocol.messages import Stop, StopTaken
from lockstep.server.audit.records import Actor
from lockstep.server.stop.stop_presses import (
    MAX_PENDING,
    MAX_REMEMBERED,
    MAX_SAME,
    AlreadyTaken,
    Held,
    NewPress,
    Press,
    Settled,
    StopPresses,
    UnderWay,
    new_press,
    press_id,
    told_id,
)


def _press(name: str, link: str = "") -> Press:
    return Press(id=name, by=Actor("Ann", link=link), where="http", reason="smoke")


def _ids(presses: StopPresses) -> list[str]:
    return [press.id for press in presses.pending]


def test_a_press_is_pending_until_the_robot_answers_it_and_in_the_order_of_pressing() -> None:
    presses = StopPresses()
    assert presses.press(_press("a")) == NewPress(_press("a"), None)
    presses.press(_press("b"))
    assert _ids(presses) == ["a", "b"]
    assert _press("a").message() == Stop(by="Ann", reason="smoke", press="a")
    assert presses.outcome("a") is None
    taken = StopTaken(press="a", number=5)
    assert presses.taken(taken) == [Settled(_press("a"), taken)]
    assert (_ids(presses), presses.outcome("a")) == (["b"], taken)


def test_a_repeat_has_the_outcome_of_its_first_also_after_it_was_answered() -> None:
    presses = StopPresses()
    presses.press(_press("a"))
    assert presses.press(_press("a")) == UnderWay(_press("a"))
    taken = StopTaken(press="a", number=5)
    presses.taken(taken)
    assert presses.press(_press("a")) == AlreadyTaken(taken)
    assert presses.taken(taken) == [], "an answer to what was sent twice"
    assert not presses.pending


def test_with_too_many_pending_the_newest_is_replaced_and_has_the_outcome_of_the_one_after_it() -> None:
    presses = StopPresses()
    for number in range(MAX_PENDING):
        presses.press(_press(str(number)))
    replaced = _press(str(MAX_PENDING - 1))
    assert presses.press(_press("one more")) == NewPress(_press("one more"), replaced)
    assert len(presses.pending) == MAX_PENDING
    assert presses.press(replaced) == UnderWay(_press("one more"))
    presses.press(_press("and more"))
    settled = presses.taken(StopTaken(press="and more", number=9))
    assert [(each.press.id, each.taken.press, each.taken.number) for each in settled] == [
        (name, name, 9) for name in ("and more", "one more", replaced.id)
    ]
    assert presses.press(replaced) == AlreadyTaken(StopTaken(press=replaced.id, number=9))


def test_a_flood_of_presses_takes_bounded_memory() -> None:
    presses = StopPresses()
    for number in range(3 * (MAX_PENDING + MAX_SAME)):
        presses.press(_press(str(number)))
    assert len(presses.pending) == MAX_PENDING
    newest = presses.pending[-1].id
    assert len(presses.taken(StopTaken(press=newest, number=1))) == 1 + MAX_SAME
    for number in range(2 * MAX_REMEMBERED):
        presses.taken(StopTaken(press=f"t{number}", number=number))
    assert presses.outcome("t0") is None
    assert presses.outcome(f"t{2 * MAX_REMEMBERED - 1}") is not None
    assert not presses.is_pending("100")


def test_what_a_link_presses_too_fast_waits_together_for_the_first_of_them_and_has_its_outcome() -> None:
    presses = StopPresses()
    first, second, third, others = _press("a", "L"), _press("b", "L"), _press("c", "L"), _press("d", "M")
    assert presses.press(first, hold=True) == Held(first, None)
    assert presses.press(second, hold=True) == UnderWay(first)
    assert presses.press(others, hold=True) == Held(others, None)
    assert presses.pending == [first, others], "nothing passes a stop that is held"
    assert all(presses.knows(each) for each in "abd")
    assert presses.take_held() == [first, others]
    assert presses.take_held() == []
    assert presses.press(third, hold=True) == Held(third, None), "the first may have been taken before this was pressed"
    settled = presses.taken(StopTaken(press="a", number=5))
    assert [(each.press.id, each.taken.number) for each in settled] == [("a", 5), ("b", 5)]
    assert presses.press(second) == AlreadyTaken(StopTaken(press="b", number=5))
    presses.taken(StopTaken(press="c", number=6))
    assert presses.take_held() == [], "sent with all that is pending, and answered"


def test_however_many_a_link_presses_too_fast_take_bounded_memory_and_are_one_stop() -> None:
    presses = StopPresses()
    for number in range(3 * MAX_SAME):
        presses.press(_press(str(number), "L"), hold=True)
    assert [press.id for press in presses.take_held()] == ["0"]
    assert len(presses.taken(StopTaken(press="0", number=1))) == 1 + MAX_SAME
    assert not presses.knows(str(2 * MAX_SAME))


def test_a_press_that_is_held_can_be_the_one_that_makes_room_for_another() -> None:
    presses = StopPresses()
    for number in range(MAX_PENDING - 1):
        presses.press(_press(str(number)))
    held, another = _press("held", "L"), _press("another", "M")
    presses.press(held, hold=True)
    assert presses.press(another) == NewPress(another, held)
    assert presses.take_held() == []
    assert presses.press(_press("next", "L"), hold=True) == Held(_press("next", "L"), another)
    assert [press.id for press in presses.take_held()] == ["next"]


def test_a_press_is_said_again_to_another_epoch_though_it_was_answered_in_the_last() -> None:
    presses = StopPresses()
    presses.press(_press("a"))
    presses.taken(StopTaken(press="a", number=5))
    assert presses.again(_press("a"))
    assert _ids(presses) == ["a"]
    assert not presses.again(_press("a"))


def test_a_press_without_an_id_gets_one_of_its_own() -> None:
    first, second = (new_press(Actor("Ann"), "http", "") for _ in range(2))
    assert first.id != second.id
    assert len(first.id) == 32
    assert press_id("", first.id) == first.id


def test_an_id_that_is_none_becomes_one_the_same_for_every_repeat_by_that_link_and_for_no_other() -> None:
    assert new_press(Actor(link="a"), "http", "", "5f" * 16).id == "5f" * 16
    odd = ("stop", "5F" * 16, "5f" * 16 + "\n", "5f" * 17, "x" * 10_000, "\ud800", " ")
    found = [press_id(link, given) for link in ("a", "b") for given in odd]
    assert all(re.fullmatch("[0-9a-f]{32}", each) for each in found)
    assert len(set(found)) == len(found)
    assert found == [press_id(link, given) for link in ("a", "b") for given in odd]


def test_a_sender_is_told_of_its_press_by_the_id_that_it_gave() -> None:
    press = new_press(Actor(link="a"), "http", "", "stop")
    assert told_id(press, "stop") == "stop"
    assert told_id(press, "") == told_id(press, "x" * 65) == press.id


def test_of_a_reason_only_what_can_be_printed_is_told() -> None:
    press = new_press(Actor("Ann"), "stop", "smoke\n   7  2026-01-01  reset  Bo\x1b[2J\u202e")
    assert press.reason == "smoke 7 2026-01-01 reset Bo[2J"
