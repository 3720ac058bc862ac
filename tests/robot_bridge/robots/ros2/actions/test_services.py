"""Calls of services whose answers do not come, or cannot be read; the node is the test's."""

from types import SimpleNamespace
from typing import Any

import pytest

from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.actions import ActionFailed, ActionNotPossible
from lockstep.robot_bridge.robots.ros2.actions.services import Services
from lockstep.robot_bridge.robots.ros2.settings import Service


class Future:
    def __init__(self) -> None:
        self.is_done = False
        self.error: Exception | None = None

    def done(self) -> bool:
        return self.is_done

    def result(self) -> Any:
        if self.error is not None:
            raise self.error
        return SimpleNamespace(success=True, message="well")


class Client:
    def __init__(self) -> None:
        self.is_there = True
        self.calls: list[Future] = []
        self.pending: list[Future] = []

    def service_is_ready(self) -> bool:
        return self.is_there

    def call_async(self, request: Any) -> Future:
        self.calls.append(Future())
        self.pending.append(self.calls[-1])
        return self.calls[-1]

    def remove_pending_request(self, future: Future) -> None:
        if future in self.pending:
            self.pending.remove(future)


@pytest.fixture
def client() -> Client:
    return Client()


@pytest.fixture
def services(client: Client) -> Services:
    ros = SimpleNamespace(interface=lambda _: SimpleNamespace(Request=SimpleNamespace), client=lambda *_: client)
    return Services(ros, [Service(name="clear", service="/clear", type="Trigger", timeout=5.0)])  # type: ignore[arg-type]


def test_an_answer_that_cannot_be_read_fails_the_action_alone(services: Services, client: Client) -> None:
    run = services.begin("clear", {})
    client.calls[0].is_done, client.calls[0].error = True, RuntimeError("failed to convert")
    with pytest.raises(ActionFailed, match="failed to convert"):
        run.step()


def test_a_call_without_an_answer_fails_in_time_and_leaves_nothing_behind(
    services: Services, client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = services.begin("clear", {})
    assert not run.step().done
    later = clock.now() + 6.0
    monkeypatch.setattr(clock, "now", lambda: later)
    with pytest.raises(ActionFailed, match="no answer within 5 s"):
        run.step()
    run.cancel()
    assert client.pending == []


def test_repeated_calls_that_are_cancelled_leave_nothing_behind(services: Services, client: Client) -> None:
    for _ in range(100):
        services.begin("clear", {}).cancel()
    assert client.pending == []


def test_a_service_that_nobody_offers_is_not_possible(services: Services, client: Client) -> None:
    client.is_there = False
    with pytest.raises(ActionNotPossible):
        services.begin("clear", {})
