"""The ends, each a process: `python -m lockstep.bench.link_transports.ends robot|console KIND HOST PORT SECONDS DIR`.

The console sends a command, waits for its feedback, and sends the next; over datagrams both are repeated as Lockstep's
commands are, and `tls-asked` pings as the console does. The robot sends pictures and answers commands, each once. The
console prints what it measured as JSON.
"""

import asyncio
import json
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path

from lockstep.bench.link_transports.messages import (
    COMMAND_BYTES,
    EVENT_SECONDS,
    FEEDBACK_BYTES,
    PICTURES_PER_SECOND,
    Message,
    framed,
    picture_bytes,
)
from lockstep.bench.link_transports.transports import Kind, Link, console_link, robot_link
from lockstep.protocol.messages import Command, Feedback
from lockstep.protocol.pacing.repeat_timer import RepeatTimer
from lockstep.robot_bridge.link.asking import Asking

__all__ = ["ConsoleEnd", "RobotEnd", "run_console", "run_robot"]

CHAIN, KEY = "chain.pem", "key.pem"
PING, PING_BYTES = 0xFFFFFFFF, 40
SHORTEST = 0.001  # s
WARM_UP = 3.0  # s that are not counted


class RobotEnd:
    """Answers each command; a repeat gets the answer again."""

    def __init__(self) -> None:
        self.link: Link | None = None

    def control(self, message: Message) -> None:
        if self.link is not None:
            self.link.send_control(framed(message.number, PING_BYTES if message.number == PING else FEEDBACK_BYTES))

    def picture(self, message: Message) -> None: ...


class ConsoleEnd:
    """Keeps the times of commands and pictures."""

    def __init__(self) -> None:
        self.trips: list[float] = []
        self.pictures: list[tuple[int, float, float]] = []  # number, sent, arrived
        self.begun = asyncio.Event()  # the robot's first message has come: it answers from now on
        self.answered = asyncio.Event()
        self.waits_for = 0

    def control(self, message: Message) -> None:
        self.begun.set()
        if message.number == self.waits_for:
            self.answered.set()

    def picture(self, message: Message) -> None:
        self.begun.set()
        self.pictures.append((message.number, message.sent, time.monotonic()))


async def run_robot(kind: Kind, host: str, port: int, folder: Path) -> None:
    """Send pictures and answer until cancelled."""
    end = RobotEnd()
    async with robot_link(kind, host, port, folder / CHAIN, end) as link:
        end.link = link
        link.send_control(framed(0, FEEDBACK_BYTES))
        number, due = 0, time.monotonic()
        while True:
            link.send_picture(framed(number, picture_bytes(number)))
            number, due = number + 1, due + 1 / PICTURES_PER_SECOND
            await asyncio.sleep(max(0.0, due - time.monotonic()))


async def run_console(
    kind: Kind, host: str, port: int, folder: Path, seconds: float, listening: Callable[[], None]
) -> dict[str, list[float]]:
    """Drive for `seconds`, after `listening` was called.

    Return in ms the trips of commands, and the delays of pictures until they could be shown.
    """
    end, timer, asking = ConsoleEnd(), RepeatTimer(), Asking()
    async with console_link(kind, host, port, folder / CHAIN, folder / KEY, end, listening) as link:
        await end.begun.wait()
        began = time.monotonic()
        while (sent := time.monotonic()) < began + WARM_UP + seconds:
            end.waits_for += 1
            end.answered.clear()
            link.send_control(framed(end.waits_for, COMMAND_BYTES))
            repeats = 0
            asking.sent(Command(event=end.waits_for, issue=1, nonce=0, values=[]), sent)
            while not end.answered.is_set():
                with suppress(TimeoutError):
                    now = time.monotonic()
                    if kind == "tls-asked" and asking.at is not None:
                        wait = max(SHORTEST, asking.at - now)
                    else:
                        wait = timer.wait(repeats + 1) if kind == "quic-datagrams" else 30.0
                    await asyncio.wait_for(end.answered.wait(), wait)
                    break
                if kind == "tls-asked":
                    link.send_control(framed(PING, PING_BYTES))
                    asking.asked(time.monotonic())
                else:
                    repeats += 1
                    link.send_control(framed(end.waits_for, COMMAND_BYTES))
            asking.received(Feedback(event=end.waits_for, issue=1, time=0.0, axes=[]), time.monotonic())
            trip = time.monotonic() - sent
            if not repeats:
                timer.sample(trip)
            if sent > began + WARM_UP:
                end.trips.append(trip)
            await asyncio.sleep(max(0.0, sent + EVENT_SECONDS - time.monotonic()))
    counted = [each for each in end.pictures if each[1] > began + WARM_UP]
    return {"trips": [1000 * trip for trip in end.trips], "pictures": _shown_delays(counted)}


def _shown_delays(pictures: list[tuple[int, float, float]]) -> list[float]:
    """Return the delays in ms until a picture and all before it had come: each needs those before it."""
    delays, newest = [], 0.0
    for _, sent, arrived in sorted(pictures):
        newest = max(newest, arrived)
        delays.append(1000 * (newest - sent))
    return delays


def main() -> None:
    side, kind, host, port, seconds, folder = sys.argv[1:]
    if side == "robot":
        asyncio.run(run_robot(kind, host, int(port), Path(folder)))  # type: ignore[arg-type]
    else:
        listening = partial(print, "listening", flush=True)
        found = asyncio.run(run_console(kind, host, int(port), Path(folder), float(seconds), listening))  # type: ignore[arg-type]
        sys.stdout.write(json.dumps(found) + "\n")


if __name__ == "__main__":
    main()
