from server.board.messages import Outcome, StopReply, StopRequest
from server.board.stop_desk import MAX_REMEMBERED, StopDesk

ID = "0123456789abcdef"


def request(number: int, *robots: str) -> StopRequest:
    return StopRequest(
        console=ID, request=f"{number:016x}", robots=robots, by="Ann", role="operator", link="", reason=""
    )


def reply(number: int, *outcomes: tuple[str, bool]) -> StopReply:
    found = tuple(Outcome(robot=robot, delivered=delivered, event=1) for robot, delivered in outcomes)
    return StopReply(console=ID, request=f"{number:016x}", robots=found)


def test_a_request_is_complete_when_every_robot_was_answered_for() -> None:
    desk = StopDesk()
    asked = desk.ask(request(1, "left", "right"))
    desk.replied(reply(1, ("left", True)))
    assert not asked.complete.is_set()
    desk.replied(reply(2, ("right", True)))
    desk.replied(reply(1, ("unasked", True)))
    assert not asked.complete.is_set()
    desk.replied(reply(1, ("right", False)))
    assert asked.complete.is_set()
    assert asked.answers["left"].delivered
    assert "sent first" in asked.answers["right"].detail


def test_of_two_answers_for_one_robot_the_worse_counts() -> None:
    desk = StopDesk()
    asked = desk.ask(request(1, "left"))
    desk.replied(reply(1, ("left", True)))
    desk.replied(reply(1, ("left", False)))
    desk.replied(reply(1, ("left", True)))
    assert not asked.answers["left"].delivered


def test_the_same_request_is_found_while_it_is_under_way() -> None:
    desk = StopDesk()
    asked = desk.ask(request(1, "left", "right"))
    assert desk.same(["right", "left"]) is asked
    assert desk.same(["left"]) is None
    assert desk.waiting == 1
    desk.end(asked)
    desk.end(asked)
    assert desk.same(["left", "right"]) is None
    assert desk.waiting == 0
    desk.replied(reply(1, ("left", True)))


def test_a_repeat_is_answered_and_not_obeyed_again_as_long_as_it_is_remembered() -> None:
    desk, done = StopDesk(), []

    def obey(number: int) -> tuple[Outcome, ...]:
        def carry_out() -> tuple[Outcome, ...]:
            done.append(number)
            return (Outcome(robot="left", delivered=True, event=number),)

        return desk.obey(request(number, "left"), carry_out)

    assert obey(1) == obey(1)
    assert done == [1]
    for number in range(2, MAX_REMEMBERED + 2):
        obey(number)
    obey(1)
    assert done[-1] == 1
