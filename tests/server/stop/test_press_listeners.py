"""Who is told of the bridge's answer to a press."""

from lockstep.server.stop.press_listeners import MAX_LISTENERS, PressListeners


def test_each_connection_is_told_once_of_a_press_by_each_id_that_it_knows() -> None:
    waiting = PressListeners()
    for told in ("mine", "mine", "p"):
        waiting.add("p", "ann", told)
    waiting.add("p", "", "p")
    assert waiting.take("p") == [("ann", "mine"), ("ann", "p")]
    assert waiting.take("p") == []


def test_a_press_has_a_bound_of_connections() -> None:
    waiting = PressListeners()
    for number in range(MAX_LISTENERS + 1):
        waiting.add("p", str(number), "p")
    assert len(waiting.take("p")) == MAX_LISTENERS


def test_presses_that_are_no_longer_pending_are_forgotten() -> None:
    waiting = PressListeners()
    waiting.add("p", "ann", "p")
    waiting.add("q", "ann", "q")
    waiting.keep(lambda press: press == "q")
    assert (waiting.take("p"), waiting.take("q")) == ([], [("ann", "q")])
