from lockstep.server.federation.board import StopAnswer
from lockstep.server.federation.messages import Outcome, StopReply, StopRequest
from lockstep.server.federation.pending_stops import MAX_REMEMBERED, PendingStops

ID = "0123456789abcdef"


def request(number: int, *robots: str) -> StopRequest:
    return StopRequest(
        console=ID, request=f"{number:016x}", robots=robots, by="Ann", role="operator", link="", reason=""
    )


def reply(number: int, *outcomes: tuple[str, bool]) -> StopReply:
    found = tuple(Outcome(robot=robot, delivered=delivered, event=1) for robot, delivered in outcomes)
    return StopReply(console=ID, request=f"{number:016x}", robots=found)


def test_a_request_is_complete_when_every_robot_was_answered_for() -> None:
    pending = PendingStops()
    asked = pending.ask(request(1, "left", "right"))
    pending.replied(reply(1, ("left", True)))
    assert not asked.complete.is_set()
    pending.replied(reply(2, ("right", True)))
    pending.replied(reply(1, ("unasked", True)))
    assert not asked.complete.is_set()
    pending.replied(reply(1, ("right", False)))
    assert asked.complete.is_set()
    assert asked.answers["left"].delivered
    assert asked.answers["right"].detail


def test_of_two_answers_for_one_robot_the_worse_counts() -> None:
    pending = PendingStops()
    asked = pending.ask(request(1, "left"))
    pending.replied(reply(1, ("left", True)))
    pending.replied(reply(1, ("left", False)))
    pending.replied(reply(1, ("left", True)))
    assert not asked.answers["left"].delivered


def test_a_request_that_nobody_waits_for_any_more_is_forgotten() -> None:
    pending = PendingStops()
    asked = pending.ask(request(1, "left", "right"))
    assert pending.waiting == 1
    pending.end(asked)
    pending.end(asked)
    assert pending.waiting == 0
    pending.replied(reply(1, ("left", True)))


def test_a_repeat_is_answered_and_not_obeyed_again_as_long_as_it_is_remembered() -> None:
    pending, first = PendingStops(), request(1, "left")
    outcomes = (Outcome(robot="left", delivered=True, event=1, number=4, kept=True),)
    assert pending.is_new(first)
    assert not pending.is_new(first)
    assert pending.outcomes(first) == (), "it is being carried out"
    pending.obeyed(first, outcomes)
    assert not pending.is_new(first)
    assert pending.outcomes(first) == outcomes
    for number in range(2, MAX_REMEMBERED + 2):
        assert pending.is_new(request(number, "left"))
    assert pending.is_new(first)


def test_the_number_of_a_stop_and_why_it_was_not_delivered_come_from_its_console() -> None:
    pending = PendingStops()
    asked = pending.ask(request(1, "left", "right"))
    outcomes = (
        Outcome(robot="left", delivered=True, event=1, number=4, kept=True),
        Outcome(robot="right", delivered=False, event=0, detail="silenced"),
    )
    pending.replied(StopReply(console=ID, request=asked.request.request, robots=outcomes))
    assert asked.answers == {
        "left": StopAnswer(True, True, 1, "", 4, kept=True),
        "right": StopAnswer(True, False, 0, "silenced"),
    }
