"""Services of the robot as its actions: std_srvs/Trigger and std_srvs/SetBool.

They move nothing, by the word of the settings' author: a service that moves the robot would go on when the bridge is
killed, and nobody could end it.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from lockstep.protocol.actions import ParameterValue
from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.actions import ActionFailed, ActionNotPossible, ActionRun, ActionStep
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from lockstep.robot_bridge.robots.ros2.sensing.words import words_of
from lockstep.robot_bridge.robots.ros2.settings import Service

__all__ = ["Services"]


class Services:
    """The clients of all services, by the action's name."""

    def __init__(self, ros: RosSide, settings: Sequence[Service]) -> None:
        """Make the clients.

        Raises:
            RobotUnavailable: std_srvs is not installed.
        """
        self._services = {each.name: (each, *_client(ros, each)) for each in settings}

    def begin(self, name: str, parameters: Mapping[str, ParameterValue]) -> ActionRun:
        """Call the service.

        Raises:
            ActionNotPossible: nobody offers it now.
        """
        settings, client, kind = self._services[name]
        if not client.service_is_ready():
            raise ActionNotPossible(f"nobody offers the service {settings.service}")
        request = kind.Request()
        if settings.type == "SetBool":
            request.data = parameters["on"] is True
        return _Call(settings, client, request)


def _client(ros: RosSide, settings: Service) -> tuple[Any, Any]:
    kind = ros.interface(f"std_srvs/srv/{settings.type}")
    return ros.client(kind, settings.service), kind


class _Call(ActionRun):
    """One call, until its answer. A call cannot be taken back: cancelled, its answer is not waited for."""

    def __init__(self, settings: Service, client: Any, request: Any) -> None:
        self._settings = settings
        self._client = client
        self._deadline = clock.now() + settings.timeout
        self._future = client.call_async(request)

    def step(self) -> ActionStep:
        if self._future.done():
            try:
                answer = self._future.result()
            except Exception as error:  # an answer that cannot be read is no reason to end the bridge
                words = f"{self._settings.service} gave no answer that can be read: {words_of(error)}"
                raise ActionFailed(words) from error
            return _outcome(answer, self._settings)
        if clock.now() > self._deadline:
            self.cancel()
            raise ActionFailed(f"{self._settings.service} gave no answer within {self._settings.timeout:g} s")
        return ActionStep(text="asked")

    def cancel(self) -> None:
        self._client.remove_pending_request(self._future)


def _outcome(answer: Any, settings: Service) -> ActionStep:
    if answer is None:  # the node ended
        raise ActionFailed(f"{settings.service} was not answered")
    text = words_of(answer.message)
    if not answer.success:
        raise ActionFailed(text or f"{settings.service} failed")
    return ActionStep(progress=1.0, text=text, done=True)
