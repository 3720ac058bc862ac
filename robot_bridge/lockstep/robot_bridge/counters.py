"""Counters of the bridge: attributes to read, which the bridge also logs at intervals."""

from collections import Counter
from dataclasses import dataclass, field

__all__ = ["BridgeCounters"]


@dataclass
class BridgeCounters:
    """Counts since the bridge started."""

    executed: int = 0  # commands executed
    issued: int = 0  # feedback issued, refreshes included
    media: int = 0  # pictures and segments captured
    skipped_ticks: int = 0  # the loop was blocked for longer than could be caught up
    left_out: Counter[str] = field(default_factory=Counter)  # pictures that were not encoded, {"link_busy": 4}
    stalls: int = 0  # the ticks were held up for longer than the watchdog allows; the robot came to rest
    watchdog: int = 0  # stalls in which a watchdog beside the loop brought the robot to rest
    actions: Counter[str] = field(default_factory=Counter)  # begun and ended, by state, {"done": 1}
    limits: Counter[str] = field(default_factory=Counter)  # spells in which a limit slowed the robot, {"charger": 2}
    refusals: Counter[str] = field(default_factory=Counter)  # by reason, {"late": 3}
    bad_input: Counter[str] = field(default_factory=Counter)  # by name, {"malformed": 1}
    drops: Counter[str] = field(default_factory=Counter)  # of links that are gone, by kind or stream, {"overview": 9}
    endings: Counter[str] = field(default_factory=Counter)  # of links, by goodbye, {"silent": 1}
