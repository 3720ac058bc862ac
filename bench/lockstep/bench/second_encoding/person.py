"""`python -m lockstep.bench.second_encoding.person LINK CA`: a client that drives or watches, in a place of its own.

It says `{}` when it sees the robot. At the word `mark` it begins to count, at `end` it says what it has seen since, as
soon as that is something: a picture, and the answer to a command that it has sent since.
"""

import asyncio
import json
import sys
import time
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lockstep.bench.harness.driving import drive_on, round_and_round
from lockstep.client import Console, ConsoleError, NotArmed

__all__ = ["Seen", "be"]

TOLERANCE = 4  # events


@dataclass
class Seen:
    """What a client has seen since the mark; times are those of the machine's monotonic clock, in s."""

    sent: list[tuple[int, float]] = field(default_factory=list)  # event, when its command was sent
    shown: list[tuple[float, int, int, int]] = field(default_factory=list)  # time, stamp, gap, width

    def has_seen(self, *, drives: bool) -> bool:
        """True if a picture came since the mark, and if it drives, the answer to a command that left after it."""
        return bool(self.shown) and (not drives or len(self.sent) > 1)

    def mark(self) -> None:
        self.sent.clear()
        self.shown.clear()


async def be(link: str, authority: Path) -> None:
    """Watch, and drive if the link lets it, until told to end."""
    seen = Seen()
    async with (
        Console(link, tolerance=TOLERANCE, codec="H264", audio=False, tls_ca=authority, connect_seconds=60) as console,
        asyncio.TaskGroup() as tasks,
    ):
        doing = [tasks.create_task(_watch(console, seen))]
        if console.role == "operator":
            await console.take_seat()
            doing.append(tasks.create_task(_drive(console, seen)))
        while not seen.shown:  # noqa: ASYNC110
            await asyncio.sleep(0.1)
        _say({})
        while word := (await asyncio.to_thread(sys.stdin.readline)).strip():
            if word == "mark":
                seen.mark()
                _say({})
            else:
                while not seen.has_seen(drives=len(doing) > 1):  # noqa: ASYNC110
                    await asyncio.sleep(0.1)
                _say({"sent": seen.sent, "shown": seen.shown})
                break
        for task in doing:
            task.cancel()


async def _watch(console: Console, seen: Seen) -> None:
    async for picture in console.pictures(keep=30):
        if picture.stamp is not None and picture.gap is not None:
            seen.shown.append((time.monotonic(), picture.stamp, picture.gap, picture.frame.width))


async def _drive(console: Console, seen: Seen) -> None:
    """Drive in circles, as fast as events come."""
    values = round_and_round(console.description)
    while True:
        with suppress(NotArmed):  # a busy machine has held the robot up
            sent = time.monotonic()
            feedback = await drive_on(console, values(sent))
            seen.sent.append((feedback.event, sent))


def _say(message: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(message) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    try:
        asyncio.run(be(sys.argv[1], Path(sys.argv[2])))
    except* ConsoleError as errors:
        sys.exit(str(errors.exceptions))
