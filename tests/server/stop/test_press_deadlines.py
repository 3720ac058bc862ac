from lockstep.server.stop.press_deadlines import PressDeadlines
from lockstep.server.stop.stop_presses import Press

A, B = Press(id="a"), Press(id="b")


def test_a_press_is_overdue_at_its_deadline_and_missed_once() -> None:
    deadlines = PressDeadlines([])
    deadlines.begin("a", 2.0)
    assert deadlines.overdue([A, B], 1.9) == []
    assert deadlines.overdue([A, B], 2.0) == [A]
    assert deadlines.miss("a")
    assert deadlines.is_late("a")
    assert deadlines.overdue([A, B], 3.0) == []
    assert not deadlines.miss("a")


def test_an_answer_ends_the_deadline_and_says_whether_it_was_late() -> None:
    deadlines = PressDeadlines(["a"])
    deadlines.begin("b", 2.0)
    assert (deadlines.end("a"), deadlines.end("b")) == (True, False)
    assert not deadlines.is_late("a")
    assert deadlines.overdue([A, B], 3.0) == []


def test_presses_that_are_no_longer_pending_are_forgotten() -> None:
    deadlines = PressDeadlines(["a", "b"])
    deadlines.begin("a", 2.0)
    deadlines.begin("b", 2.0)
    deadlines.keep(lambda press: press == "b")
    assert (deadlines.is_late("a"), deadlines.is_late("b")) == (False, True)
    assert deadlines.overdue([A, B], 3.0) == [B]
