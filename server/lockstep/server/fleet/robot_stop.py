"""STOP at one robot of a fleet."""

from typing import NamedTuple

from lockstep.server.errors import Silenced
from lockstep.server.fleet.session import FleetSession
from lockstep.server.fleet.summaries import UNREADABLE
from lockstep.server.stop.stop_presses import Press
from lockstep.server.telemetry.faults import Faults

__all__ = ["Stopped", "stop_robot"]


class Stopped(NamedTuple):
    """The outcome of a STOP at one robot."""

    name: str
    delivered: bool
    event: int
    detail: str  # why it was not delivered; "" when it was
    number: int = 0  # of the stop at that robot; 0 when it was not delivered
    console: str = ""  # console of the robot; "" is this one
    kept: bool = False  # on that robot's disk


async def stop_robot(session: FleetSession, press: Press, faults: Faults) -> Stopped:
    """Stop one robot of this console. Raises nothing: a fault with it must not keep the stop from the others."""
    try:
        answer = await session.stop(press)
    except Silenced as error:
        return Stopped(session.name, False, 0, error.detail)
    except Exception as error:
        faults.caught("stop", error, robot=session.name)
        return Stopped(session.name, False, 0, UNREADABLE)
    outcome = answer.outcome
    return Stopped(session.name, outcome.delivered, answer.event, outcome.detail, outcome.number, kept=outcome.kept)
