"""A policy in a process of its own: `python -m lockstep.bench.episodes.faults.policy_process LINK NAME`.

It visits places whenever a person offers it the seat, until it is killed.
"""

import asyncio
import sys
from itertools import count

from lockstep.bench.episodes.policy_turn import PolicyTurn
from lockstep.bench.episodes.visits import PLACES, Visit, places_near
from lockstep.bench.harness.asked import say
from lockstep.bench.pick_place.hands import PolicyHand
from lockstep.client import Console

__all__ = ["drive_on"]


async def drive_on(link: str, name: str) -> None:
    """Drive until cancelled. Says the peer's id once it is connected."""
    async with Console(link, video=False, audio=False, name=name) as console:
        say({"peer": console.peer})
        places = places_near(console.description, await anext(aiter(console.feedbacks())))
        hand, numbers = PolicyHand(console.description), count()

        def next_visit() -> Visit:
            return Visit(console.description, places[next(numbers) % len(PLACES)], hand)

        await PolicyTurn(console, next_visit, None).drive()


if __name__ == "__main__":
    asyncio.run(drive_on(*sys.argv[1:]))
