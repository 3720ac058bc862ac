"""The command `lockstep drive --teleop`."""

import argparse
import asyncio
import os
import signal
import sys
from collections.abc import Sequence

from lockstep.client.console import Console
from lockstep.client.errors import ConsoleError
from lockstep.client.lead.drive import lead
from lockstep.client.lead.hands import KeyHand, PedalHand
from lockstep.client.lead.leader import Leader, LeaderFailed, Newest
from lockstep.client.lead.mapping import BadMapping, map_axes

__all__ = ["arguments", "main"]

PREFIX = "--teleop."
EXIT_FAILED = 1
EXIT_USAGE = 2


def arguments(program: str) -> argparse.ArgumentParser:
    """Return the command's parser."""
    parser = argparse.ArgumentParser(
        prog=program,
        description="Drive a robot's goal axes by a leader arm of LeRobot. It moves only while the key is held.",
        epilog="Flags that begin with --teleop. are LeRobot's own: --teleop.port=/dev/ttyACM1 --teleop.id=left",
        allow_abbrev=False,
    )
    parser.add_argument("link", nargs="?", default=os.environ.get("LOCKSTEP_LINK", ""))
    parser.add_argument("--teleop", metavar="TYPE", help="LeRobot's type of the leader, such as so101_leader")
    parser.add_argument(
        "--lerobot-python",
        default=os.environ.get("LOCKSTEP_LEROBOT_PYTHON", ""),
        help="the Python that has LeRobot; or LOCKSTEP_LEROBOT_PYTHON",
    )
    parser.add_argument("--map", action="append", default=[], metavar="ENTRY=AXIS*SCALE", help="repeat for several")
    parser.add_argument("--pedal", metavar="DEVICE", help="hold this input device's key instead of the space bar")
    parser.add_argument("--rate", type=float, default=60.0, help="readings of the leader a second")
    parser.add_argument("--tls-ca", help="certificate to trust instead of the system's")
    parser.add_argument("--name", default="leader", help="the name that other participants see")
    return parser


def main(words: Sequence[str], program: str = "lockstep drive") -> int:
    """Run the command; return its exit code."""
    parser = arguments(program)
    options, more = parser.parse_known_args(list(words))
    flags = [word for word in more if word.startswith(PREFIX) and "=" in word]
    if wrong := [word for word in more if word not in flags]:
        parser.error(f"unrecognized: {' '.join(wrong)} (LeRobot's flags are --teleop.NAME=VALUE)")
    if options.teleop:
        flags.append(f"{PREFIX}type={options.teleop}")
    if not any(flag.startswith(f"{PREFIX}type=") for flag in flags):
        parser.error("--teleop TYPE is missing")
    if not options.link:
        parser.error("the link is missing: give it, or set LOCKSTEP_LINK")
    if not options.lerobot_python:
        parser.error("--lerobot-python is missing")
    if not 1 <= options.rate <= 500:
        parser.error("--rate has to be between 1 and 500")
    options.lerobot_python = os.path.expanduser(options.lerobot_python)
    try:
        asyncio.run(_drive(options, flags))
    except BadMapping as error:
        print(f"{program}: {error}", file=sys.stderr)  # noqa: T201
        return EXIT_USAGE
    except (ConsoleError, LeaderFailed, OSError) as error:
        print(f"{program}: {error}", file=sys.stderr)  # noqa: T201
        return EXIT_FAILED
    return 0


async def _drive(options: argparse.Namespace, flags: Sequence[str]) -> None:
    hand = KeyHand() if options.pedal is None else PedalHand(options.pedal)
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        loop.add_signal_handler(number, hand.quit.set)
    async with (
        Leader(options.lerobot_python, flags, options.rate) as leader,
        Console(options.link, name=options.name, tls_ca=options.tls_ca, video=False, audio=False) as console,
    ):
        mapping = map_axes(console.description, leader.names, options.map)
        newest = Newest(mapping.names)
        await console.take_seat()
        with hand.reading():
            failed: list[LeaderFailed] = []

            async def read() -> None:
                try:
                    await leader.read_into(newest)
                except LeaderFailed as error:  # the robot comes to rest first
                    failed.append(error)
                hand.quit.set()

            try:
                async with asyncio.TaskGroup() as tasks:
                    reading = tasks.create_task(read(), name="leader")
                    await lead(console, console.clutch(mapping.scales), newest, hand, _say)
                    reading.cancel()
            except BaseExceptionGroup as errors:  # of `lead`
                raise errors.exceptions[0] from None
        for error in failed:
            raise error


def _say(text: str) -> None:
    print(text, flush=True)  # noqa: T201


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:], "python -m lockstep.client.lead.cli"))
