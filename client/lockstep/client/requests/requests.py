"""The requests that a connection can make, once it has a transport."""

from dataclasses import dataclass
from typing import Self

from lockstep.client.control.driving import Driving
from lockstep.client.episodes import Episodes
from lockstep.client.message_dispatcher import MessageDispatcher
from lockstep.client.requests.exchange import Exchange
from lockstep.client.requests.notes import Notes
from lockstep.client.requests.seat_requests import SeatRequests
from lockstep.client.requests.stop_requests import StopRequests
from lockstep.client.robot_actions import RobotActions
from lockstep.client.session import Session
from lockstep.client.transport.transport import Transport

__all__ = ["Requests"]


@dataclass(frozen=True)
class Requests:
    """One object for each subject of requests."""

    seat: SeatRequests
    stop: StopRequests
    notes: Notes
    actions: RobotActions
    episodes: Episodes

    @classmethod
    def over(cls, transport: Transport, session: Session, driving: Driving, messages: MessageDispatcher) -> Self:
        """Make requests over this transport; `messages` has the answers."""
        until = messages.until
        exchange = Exchange(transport, session, until)
        return cls(
            SeatRequests(transport, session, driving, exchange, until),
            StopRequests(transport, session, driving, exchange, until),
            Notes(session, exchange),
            RobotActions(transport, session, driving, messages.news, until),
            Episodes(transport, messages.episodes, until),
        )
