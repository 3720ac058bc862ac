"""The settings of a connection that watches."""

from lockstep.client.connection_options import ConnectionOptions
from lockstep.client.console_url import ConsoleLink

__all__ = ["options"]

SECONDS = 20.0  # a busy machine


def options(link: ConsoleLink) -> ConnectionOptions:
    return ConnectionOptions(
        link=link,
        pacing="feedback",
        tolerance={"video": 4, "audio": 6},
        gate="event",
        carrier="trailer",
        video=0,
        audio=False,
        decode=False,
        codec=None,
        sound_codec=None,
        event_rate=None,
        name="ann",
        connect_seconds=SECONDS,
        silence_seconds=SECONDS,
        route=None,
    )
