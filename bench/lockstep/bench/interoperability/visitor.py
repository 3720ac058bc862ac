"""One client of a cell, in a process that may be in another network namespace.

`python -m lockstep.bench.interoperability.visitor CLIENT LINK SECONDS [DOOR]`: drives for this time and prints the
result as one JSON line. CLIENT is `headless`, `janus`, `chromium` or `firefox`. DOOR is an address host:port to which a
port of loopback leads, so that a page has a secure origin although its console speaks HTTP.
"""

import asyncio
import contextlib
import json
import sys
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from lockstep.bench.experiment.choices import Choices
from lockstep.bench.experiment.endurance.endurance import Endurance
from lockstep.bench.experiment.endurance.endurance_run import Driven, HeadlessHands
from lockstep.bench.harness.tcp_path import TcpPath
from lockstep.client import Console
from lockstep.server.util.background_tasks import background_tasks

__all__ = ["main"]

LIVE_SECONDS = 90.0
TOLERANCE = 4  # events
RELAY_ONLY = "&relay=only"  # of a link: through TURN or not at all


@asynccontextmanager
async def _driven(client: str, link: str) -> AsyncIterator[Driven]:
    choices = Choices("perfect", "feedback", 0.0, TOLERANCE, 1)
    if client == "headless":
        bare, _, relay = link.partition(RELAY_ONLY)
        yield HeadlessHands(bare, choices, relay_only=link != bare + relay)
    elif client in ("chromium", "firefox"):
        from lockstep.bench.experiment.endurance.endurance_page import driven_page  # needs browsers

        async with driven_page("chromium" if client == "chromium" else "firefox", link, choices) as page:
            yield page
    else:
        raise SystemExit(f"{client} is no client")


async def _drive(client: str, link: str, seconds: float) -> dict[str, Any]:
    endurance = Endurance()
    async with _driven(client, link) as driven:
        async with asyncio.timeout(LIVE_SECONDS):
            await driven.until_live()
        began = time.monotonic()
        async with background_tasks(driven.run(endurance, lambda: time.monotonic() - began)):
            await asyncio.sleep(seconds)
    found = endurance.fields()
    return {
        "pictures": found["pictures"],
        "events": round(found["driven_seconds"]),
        "violations": found["violations"],
        "reconnections": found["reconnections"],
    }


async def _watch_through_janus(link: str, seconds: float) -> dict[str, Any]:
    async with Console(link, through_relay=True, name="observer", connect_seconds=LIVE_SECONDS) as console:
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                async for _ in console.pictures():
                    pass
        found = console.stats()
        return {
            "pictures": sum(each.rendered for each in found.streams if each.kind == "video"),
            "events": found.event or 0,
            "violations": sum(each.violations for each in found.streams),
            "reconnections": 0,
        }


async def visit(client: str, link: str, seconds: float, door: str) -> dict[str, Any]:
    if client == "janus":
        return await _watch_through_janus(link, seconds)
    if not door:
        return await _drive(client, link, seconds)
    host, _, port = door.rpartition(":")
    async with TcpPath((host.strip("[]"), int(port))) as path:
        behind = link.partition("://")[2].partition("/")[2]
        return await _drive(client, f"http://127.0.0.1:{path.port}/{behind}", seconds)


def main() -> None:
    client, link, seconds, *door = sys.argv[1:]
    print(json.dumps(asyncio.run(visit(client, link, float(seconds), "".join(door)))), flush=True)


if __name__ == "__main__":
    main()
