"""What other consoles may ask of this one, and tell it."""

from collections.abc import Mapping

from lockstep.server.audit.records import Actor
from lockstep.server.auth.invitations import Invitation
from lockstep.server.federation.board import StopAnswer
from lockstep.server.fleet.robot_stop import stop_robot
from lockstep.server.fleet.session import FleetSession
from lockstep.server.state.console_context import ConsoleContext
from lockstep.server.stop.stop_presses import Press
from lockstep.server.telemetry.faults import Faults

__all__ = ["FleetBoardHost"]

ELSEWHERE = Actor("another console")


class FleetBoardHost:
    """The `BoardHost` of a fleet. `sessions`: by the robots' names."""

    def __init__(self, sessions: Mapping[str, FleetSession], context: ConsoleContext, faults: Faults) -> None:
        self._sessions = sessions
        self._context = context
        self._faults = faults

    async def stop_robot(self, name: str, press: Press) -> StopAnswer:
        """Stop one robot for somebody at another console."""
        session = self._sessions.get(name)
        if session is None:
            return StopAnswer(True, False, 0, "that console does not have this robot")
        stopped = await stop_robot(session, press, self._faults)
        return StopAnswer(True, stopped.delivered, stopped.event, stopped.detail, stopped.number, stopped.kept)

    def silences(self) -> dict[str, float]:
        return self._context.silences()

    def silenced_elsewhere(self, console: str, links: Mapping[str, float]) -> None:
        self._context.silenced_elsewhere(console, links)

    def links_revoked(self, ended: list[Invitation]) -> None:
        self._context.enforce(ended, ELSEWHERE)
