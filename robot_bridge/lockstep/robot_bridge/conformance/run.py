"""Plays the cases against a bridge, one after the other."""

import asyncio
import contextlib
from collections.abc import Callable, Sequence

from lockstep.protocol.errors import LinkLost, LinkRefused
from lockstep.robot_bridge.conformance.case import Case, Outcome, Result
from lockstep.robot_bridge.conformance.cases.action_cases import ACTION_CASES
from lockstep.robot_bridge.conformance.cases.event_cases import EVENT_CASES
from lockstep.robot_bridge.conformance.cases.goal_cases import GOAL_CASES
from lockstep.robot_bridge.conformance.cases.link_cases import LINK_CASES
from lockstep.robot_bridge.conformance.cases.media_cases import MEDIA_CASES
from lockstep.robot_bridge.conformance.cases.rest_cases import REST_CASES
from lockstep.robot_bridge.conformance.cases.stop_cases import STOP_CASES
from lockstep.robot_bridge.conformance.errors import NotApplicable, StoppedByOther, Violation
from lockstep.robot_bridge.conformance.subject import Subject

__all__ = ["CASES", "play", "play_all"]

CASES: tuple[Case, ...] = (
    *(*LINK_CASES, *EVENT_CASES, *REST_CASES, *STOP_CASES),
    *(*GOAL_CASES, *ACTION_CASES, *MEDIA_CASES),
)
CASE_SECONDS = 120.0  # a robot may warn for 30 s each time before it moves


async def play_all(subject: Subject, cases: Sequence[Case], tell: Callable[[Result], None]) -> list[Result]:
    """Play the cases, and return the results in order; `tell` gets each as soon as it is known.

    Raises:
        NotReady: the robot is stopped, locked or taken.
        LinkLost: no process listens there.
    """
    with contextlib.suppress(Violation):  # the cases report it
        await subject.first_look()
    results: list[Result] = []
    over = ""  # why no further case can be tried
    for case in cases:
        result = Result(case, Outcome.NOT_TRIED, over) if over else await play(subject, case)
        if not over and (over := await _cleaned_up(subject)) and result.outcome is Outcome.OK:
            result = Result(case, Outcome.FAILED, over)
        results.append(result)
        tell(result)
    return results


async def play(subject: Subject, case: Case) -> Result:
    """Play one case; the robot may be stopped afterwards."""
    try:
        async with asyncio.timeout(CASE_SECONDS):
            await case.play(subject)
    except NotApplicable as error:
        return Result(case, Outcome.NOT_APPLICABLE, str(error))
    except StoppedByOther as error:
        return Result(case, Outcome.NOT_TRIED, str(error))
    except Violation as error:
        return Result(case, Outcome.FAILED, str(error))
    except (LinkLost, LinkRefused) as error:
        return Result(case, Outcome.FAILED, error.detail)
    except TimeoutError:
        return Result(case, Outcome.FAILED, "what has to happen did not happen in time")
    return Result(case, Outcome.OK)


async def _cleaned_up(subject: Subject) -> str:
    """Clean up. Return why the check cannot go on; "" if the robot is at rest and released."""
    try:
        await subject.clean_up()
    except (Violation, StoppedByOther) as error:
        return f"after the case: {error}"
    except (LinkLost, LinkRefused) as error:
        return f"after the case the bridge does not answer: {error.detail}"
    except TimeoutError:
        return "after the case the robot does not come to rest"
    return ""
