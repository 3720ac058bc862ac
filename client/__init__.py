"""A console without a browser, for scripts, tests and policies."""

from client.console import Console
from client.errors import (
    CommandError,
    CommandRefused,
    ConnectFailed,
    ConsoleError,
    ConsoleLost,
    LinkFormatError,
    NoSuchStream,
    NotArmed,
    Refused,
    SeatRefused,
    SignallingRefused,
    StopUnconfirmed,
)
from client.statistics import ConsoleStatistics, Percentiles, StreamStatistics
from client.stream import Picture, Sound

__all__ = [
    "CommandError",
    "CommandRefused",
    "ConnectFailed",
    "Console",
    "ConsoleError",
    "ConsoleLost",
    "ConsoleStatistics",
    "LinkFormatError",
    "NoSuchStream",
    "NotArmed",
    "Percentiles",
    "Picture",
    "Refused",
    "SeatRefused",
    "SignallingRefused",
    "Sound",
    "StopUnconfirmed",
    "StreamStatistics",
]
