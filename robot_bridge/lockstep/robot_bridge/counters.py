"""What the bridge counts. Read it as attributes; the bridge logs it at intervals."""

from collections import Counter
from dataclasses import dataclass, field

__all__ = ["BridgeCounters"]


@dataclass
class BridgeCounters:
    """Counts since the bridge started."""

    executed: int = 0  # commands
    issued: int = 0  # feedback, refreshes included
    media: int = 0  # pictures and segments captured
    skipped_ticks: int = 0  # the loop was blocked for longer than could be caught up
    stalls: int = 0  # the ticks were held up for longer than the watchdog allows; the robot came to rest
    watchdog: int = 0  # of these, something beside the loop brought it to rest meanwhile
    limits: Counter[str] = field(default_factory=Counter)  # spells in which one slowed the robot, {"charger": 2}
    refusals: Counter[str] = field(default_factory=Counter)  # by reason, {"late": 3}
    bad_input: Counter[str] = field(default_factory=Counter)  # by name, {"malformed": 1}
    drops: Counter[str] = field(default_factory=Counter)  # of links that are gone, by kind or stream, {"overview": 9}
    endings: Counter[str] = field(default_factory=Counter)  # of links, by goodbye, {"silent": 1}
