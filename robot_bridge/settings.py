"""Settings of a bridge. What belongs to the robot (hold, ages, limits) is in its description."""

from dataclasses import dataclass
from pathlib import Path

from robot_bridge.protocol.serial import FIRST_EVENT

__all__ = ["BridgeSettings"]


@dataclass(frozen=True, kw_only=True)
class BridgeSettings:
    host: str = "127.0.0.1"
    port: int = 5600  # 0: any free one
    event_log: Path | None = None  # JSON lines of all that happened to events; None writes nothing
    first_event: int = FIRST_EVENT  # tests start near the wrap
    max_links: int = 32
    log_interval: float = 60.0  # s between log lines with the counters
