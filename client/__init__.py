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
    Refused,
    SeatRefused,
    SignallingRefused,
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
    "Percentiles",
    "Picture",
    "Refused",
    "SeatRefused",
    "SignallingRefused",
    "Sound",
    "StreamStatistics",
]
