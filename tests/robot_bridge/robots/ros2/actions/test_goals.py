"""Goals whose server cannot be found for a while. The server is made here: no DDS loses its path on demand."""

from concurrent.futures import Future
from types import SimpleNamespace
from typing import Any, cast

import pytest

from lockstep.robot_bridge.robots.actions import ActionNotPossible
from lockstep.robot_bridge.robots.ros2.actions.goals import GONE, GoalClient, Reading
from lockstep.robot_bridge.robots.ros2.actions.id_cancel import ANSWER_SECONDS, CANCEL_AGAIN, TERMINATED, UNKNOWN_GOAL
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide


class Server:
    """An action client, its server and the goal's handle in one."""

    accepted = True

    def __init__(self) -> None:
        self.is_found = True
        self.answers = True
        self.cancels = 0
        self.results: list[Future[Any]] = []
        self.accepting: list[Future[Any]] = []
        self.asked: list[Future[Any]] = []  # cancels by the goal's id alone

    def server_is_ready(self) -> bool:
        return self.is_found

    def send_goal_async(self, goal: object, feedback_callback: object, goal_uuid: object) -> Future[Any]:
        self.accepting.append(Future())
        if self.answers:
            self.accepting[-1].set_result(self)
        return self.accepting[-1]

    def call_async(self, request: object) -> Future[Any]:
        self.asked.append(Future())
        return self.asked[-1]

    def remove_pending_request(self, future: Future[Any]) -> None:
        future.cancel()

    def says(self, code: int) -> None:
        """Answer the newest cancel."""
        self.asked[-1].set_result(SimpleNamespace(return_code=code))

    def get_result_async(self) -> Future[Any]:
        self.results.append(Future())
        return self.results[-1]

    def cancel_goal_async(self) -> None:
        self.cancels += 1


@pytest.fixture
def server() -> Server:
    return Server()


@pytest.fixture
def goals(server: Server) -> GoalClient:
    request = SimpleNamespace(goal_info=SimpleNamespace(goal_id=None))

    class Interface(SimpleNamespace):
        Request = staticmethod(lambda: request)

    ros = SimpleNamespace(
        full_name=str,
        action_client=lambda kind, action: server,
        interface=lambda name: Interface,
        client=lambda kind, service: server,
    )
    return GoalClient(cast(RosSide, ros), "x/Y", "/dock", timeout=5.0)


def lost_and_found(goals: GoalClient, server: Server) -> float:
    """A goal runs, its server is lost, the operator lets go, and the server is found much later; return the time."""
    run = goals.begin(object(), Reading())
    run.step()
    server.is_found = False
    run.cancel()
    cancelled_at = cast(float, run._cancelled_at)
    for seconds in (GONE + 1, 60.0):
        goals.tick(cancelled_at + seconds)
    assert server.cancels == 0
    assert any("may still move" in fault for fault in goals.faults(cancelled_at + 60.0))
    server.is_found = True
    goals.tick(cancelled_at + 61.0)
    assert server.cancels == 1
    return cancelled_at + 61.0


def test_a_goal_whose_server_was_lost_is_cancelled_when_it_is_found_again(goals: GoalClient, server: Server) -> None:
    now = lost_and_found(goals, server)
    goals.tick(now + 2 * CANCEL_AGAIN)
    assert server.cancels == 2
    with pytest.raises(ActionNotPossible, match="has not ended"):
        goals.begin(object(), Reading())


def test_the_goal_has_ended_when_its_server_answers_for_the_result(goals: GoalClient, server: Server) -> None:
    """Also one that was restarted, and says that it knows no such goal."""
    now = lost_and_found(goals, server)
    server.results[-1].set_result(None)
    goals.tick(now + 0.01)
    assert not goals.has_ending
    assert goals.faults(now + 0.01) == []
    goals.begin(object(), Reading())


def test_a_server_that_is_found_again_is_asked_for_the_result_once(goals: GoalClient, server: Server) -> None:
    now = lost_and_found(goals, server)
    assert len(server.results) == 2
    for step in range(10):
        goals.tick(now + step)
    assert len(server.results) == 2


def unanswered(goals: GoalClient, server: Server) -> float:
    """A goal was sent and cancelled, and its server has not answered; return the time."""
    server.answers = False
    run = goals.begin(object(), Reading())
    run.cancel()
    return cast(float, run._cancelled_at)


def given_up(goals: GoalClient, server: Server) -> float:
    """The server has said for long enough that it does not know the goal; return the time."""
    now = unanswered(goals, server)
    while goals.has_ending:
        if not server.asked[-1].done():
            server.says(UNKNOWN_GOAL)
        now += CANCEL_AGAIN
        goals.tick(now)
    return now


def test_a_goal_that_was_not_answered_before_its_server_was_lost_is_not_forgotten(
    goals: GoalClient, server: Server
) -> None:
    now = unanswered(goals, server)
    server.is_found = False
    for seconds in (GONE + 1, 600.0):
        goals.tick(now + seconds)
    assert any("may still move" in fault for fault in goals.faults(now + 600.0))
    server.is_found = True
    goals.tick(now + 601.0)
    assert len(server.asked) == 2, "the server is asked by the goal's id, whether it has accepted it or not"
    server.says(TERMINATED)
    goals.tick(now + 601.1)
    assert not goals.has_ending


def test_a_server_has_to_say_for_a_while_that_it_does_not_know_the_goal(goals: GoalClient, server: Server) -> None:
    began = unanswered(goals, server)
    server.says(UNKNOWN_GOAL)
    goals.tick(began + 1.0)
    server.says(0)  # it has accepted the goal, and its answer to that was lost: it is asked until the goal has ended
    goals.tick(began + 2.0)
    server.says(UNKNOWN_GOAL)
    goals.tick(began + 3.0)
    goals.tick(began + 7.0)
    assert goals.has_ending
    server.says(UNKNOWN_GOAL)
    goals.tick(began + 8.1)
    goals.begin(object(), Reading())
    assert goals.faults(began + 60.0) == []


def test_a_goal_that_is_accepted_after_it_was_given_up_is_cancelled_at_once(goals: GoalClient, server: Server) -> None:
    now = given_up(goals, server)
    server.answers = True
    goals.begin(object(), Reading())  # the next goal goes on
    server.accepting[0].set_result(server)
    goals.tick(now + 60.0)
    assert server.cancels == 1
    assert goals.has_ending
    server.results[-1].set_result(None)
    goals.tick(now + 61.0)
    assert not goals.has_ending


def test_a_goal_that_is_refused_after_it_was_given_up_is_over(goals: GoalClient, server: Server) -> None:
    now = given_up(goals, server)
    server.accepting[0].set_result(SimpleNamespace(accepted=False))
    goals.tick(now + 1)
    goals.tick(now + 2)
    assert (server.cancels, goals.has_ending) == (0, False)


def test_a_cancel_that_is_not_answered_or_that_cannot_be_read_is_sent_again(goals: GoalClient, server: Server) -> None:
    now = unanswered(goals, server)
    for seconds in (CANCEL_AGAIN, ANSWER_SECONDS - 0.1, ANSWER_SECONDS + 0.1):
        goals.tick(now + seconds)
    assert len(server.asked) == 2
    server.asked[-1].set_exception(RuntimeError("no message"))
    goals.tick(now + ANSWER_SECONDS + 0.5)
    assert len(server.asked) == 3
    assert goals.has_ending
