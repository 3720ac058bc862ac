"""The crowd: `python -m lockstep.bench.hostile.crowd [--idle] LINK OPERATOR BRIDGE COUNT SEED [KIND]`.

LINK is an observer's, OPERATOR the link of a peer that publishes a camera and speaks, BRIDGE is tls://host:port.
With `--idle` it runs with the processor time that no other process wants (SCHED_IDLE): attackers have their own
machines. It prints a JSON line when it has begun, answers each line on standard input with its counts, and ends at the
end of its input.
"""

import asyncio
import os
import sys
from collections import Counter
from random import Random
from urllib.parse import urlsplit

import httpx
import uvloop

from lockstep.bench.harness.asked import answer, say
from lockstep.bench.hostile import over_http, over_robot_link, over_webrtc, over_whip
from lockstep.bench.hostile.target import Misbehaviour, Target
from lockstep.client.console_url import parse_link
from lockstep.server.util.background_tasks import background_tasks

__all__ = ["KINDS", "Crowd", "main"]

PAUSE = 0.2  # s between two attempts of one member, on average

KINDS: tuple[Misbehaviour, ...] = (
    over_http.garbage_bytes,
    over_http.slow_requests,
    over_http.forged_tokens,
    over_http.many_requests,
    over_http.giant_offers,
    over_webrtc.half_open,
    over_webrtc.garbage_datagrams,
    over_webrtc.message_flood,
    over_webrtc.garbage_messages,
    over_webrtc.forged_commands,
    over_webrtc.reset_spam,
    over_webrtc.slow_reader,
    over_webrtc.restart_flood,
    over_http.scene_flood,
    over_http.stop_flood,
    over_http.health_flood,
    over_http.address_flood,
    over_http.body_holders,
    over_http.slow_posts,
    over_http.silent_connections,
    over_http.non_readers,
    over_http.recordings_reader,
    over_webrtc.many_sections,
    over_webrtc.stun_flood,
    over_webrtc.media_flood,
    over_whip.publisher_flood,
    over_robot_link.bridge_handshakes,
    over_robot_link.bridge_silence,
)


class Crowd:
    """Members that take the kinds in turn; each attacks again and again until the task is cancelled."""

    def __init__(
        self, link: str, operator: str, bridge: str, count: int, seed: int, kinds: tuple[Misbehaviour, ...] = KINDS
    ) -> None:
        self.attempts: Counter[str] = Counter()
        self.failures: Counter[str] = Counter()  # attempts that ended in an error of the crowd's own
        self.seen: Counter[str] = Counter()
        self._link, self._operator = parse_link(link), parse_link(operator).token
        parts = urlsplit(bridge)
        self._bridge = (parts.hostname or "", parts.port or 0)
        self._members = [(kinds[number % len(kinds)], Random(seed * 1000 + number)) for number in range(count)]

    async def run(self) -> None:
        """Attack until cancelled."""
        limits = httpx.Limits(max_connections=200)
        async with httpx.AsyncClient(
            base_url=self._link.base, trust_env=False, limits=limits, timeout=10, verify=False
        ) as http:
            target = Target(self._link.base, self._link.token, self._operator, self._bridge, http, self.seen)
            async with asyncio.TaskGroup() as tasks:
                for kind, random in self._members:
                    tasks.create_task(self._member(kind, target, random))

    async def _member(self, kind: Misbehaviour, target: Target, random: Random) -> None:
        await asyncio.sleep(random.uniform(0, 2 * PAUSE))
        while True:
            self.attempts[kind.__name__] += 1
            try:
                await kind(target, random)
            except Exception as error:  # a peer that breaks all rules breaks aiortc's own assumptions too
                self.failures[f"{kind.__name__}: {type(error).__name__}"] += 1
            await asyncio.sleep(random.uniform(0, 2 * PAUSE))

    def summary(self) -> dict[str, dict[str, int]]:
        return {"attempts": dict(self.attempts), "seen": dict(self.seen), "failures": dict(self.failures)}


async def _run(link: str, operator: str, bridge: str, count: int, seed: int, only: str = "") -> None:
    crowd = Crowd(link, operator, bridge, count, seed, tuple(kind for kind in KINDS if only in ("", kind.__name__)))
    async with background_tasks(crowd.run()):
        say({"members": count})
        await answer(crowd.summary)


def main() -> None:
    arguments = sys.argv[1:]
    if arguments[0] == "--idle":
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))  # before there are threads, which inherit it
        del arguments[0]
    link, operator, bridge, count, seed, *kind = arguments
    uvloop.run(_run(link, operator, bridge, int(count), int(seed), *kind[:1]))


if __name__ == "__main__":
    main()
