from typing import Any

from lockstep.bench.episodes.turns import Span, Turn, differences

TURNS = (Turn("Ada", "human", 11, 20), Turn("net", "policy", 22, 30), Turn("Ada", "human", 33, 40))
SPANS = [
    Span("Ada", "human", False, 11, 21),
    Span("net", "policy", False, 22, 31),
    Span("Ada", "human", True, 32, 41),
]


def _changed(number: int, **fields: Any) -> list[Span]:
    return [each._replace(**fields) if place == number else each for place, each in enumerate(SPANS)]


def test_rows_of_those_who_drove_differ_in_nothing_and_an_answer_that_a_driver_missed_is_no_difference() -> None:
    assert differences(SPANS, TURNS, "Ada") == []


def test_a_person_who_rested_before_the_policys_turn_is_no_difference() -> None:
    spans = [Span("Ada", "human", False, 20, 20), *SPANS[1:]]
    assert differences(spans, TURNS[1:], "Ada") == []
    assert differences(spans, TURNS[1:], "Grace") != []


def test_another_driver_a_missing_one_and_one_too_many_are_told() -> None:
    assert "driven by Ada (human)" in differences(_changed(1, driver="Grace"), TURNS, "Ada")[0]
    assert differences(SPANS[:2], TURNS, "Ada") != []
    assert differences([*SPANS, SPANS[1]], TURNS, "Ada") != []
    assert "nobody" in differences([], TURNS, "Ada")[0]


def test_a_wrong_kind_and_a_wrong_intervention_are_told() -> None:
    assert "kind human" in differences(_changed(1, kind="human"), TURNS, "Ada")[0]
    assert "no intervention" in differences(_changed(2, intervention=False), TURNS, "Ada")[0]
    assert "an intervention" in differences(_changed(0, intervention=True), TURNS, "Ada")[0]


def test_rows_of_another_drivers_events_are_told() -> None:
    assert "rows of events 20 to 31" in differences(_changed(1, first_event=20), TURNS, "Ada")[0]
    assert "rows of events 22 to 33" in differences(_changed(1, last_event=33), TURNS, "Ada")[0]
    assert "no row of its own" in differences(_changed(1, first_event=21, last_event=21), TURNS, "Ada")[-1]
