"""Goals whose server cannot be found for a while. The server is made here: no DDS loses its path on demand."""

from concurrent.futures import Future
from types import SimpleNamespace
from typing import Any, cast

import pytest

from lockstep.robot_bridge.robots.actions import ActionNotPossible
from lockstep.robot_bridge.robots.ros2.actions.goals import CANCEL_AGAIN, GONE, GoalClient, Reading
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide


class Server:
    """An action client, its server and the goal's handle in one."""

    accepted = True

    def __init__(self) -> None:
        self.is_found = True
        self.cancels = 0
        self.results: list[Future[Any]] = []

    def server_is_ready(self) -> bool:
        return self.is_found

    def send_goal_async(self, goal: object, feedback_callback: object) -> Future[Any]:
        accepting: Future[Any] = Future()
        accepting.set_result(self)
        return accepting

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
    ros = SimpleNamespace(action=lambda type: type, full_name=str, action_client=lambda kind, action: server)
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
