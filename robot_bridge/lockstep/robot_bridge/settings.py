"""Settings of a bridge. The robot's own settings (hold, ages, limits) are in its description."""

from dataclasses import dataclass
from pathlib import Path

from lockstep.protocol.link_secret import LinkSecret
from lockstep.protocol.serial import FIRST_EVENT
from lockstep.robot_bridge.dial.console_access import ConsoleAccess
from lockstep.robot_bridge.encoding.encoder_choice import EncodeSettings
from lockstep.robot_bridge.link.link_tls import LinkTls

__all__ = ["BridgeSettings"]


@dataclass(frozen=True, kw_only=True)
class BridgeSettings:
    host: str = "127.0.0.1"
    port: int = 5600  # 0: any free one
    listen: bool = True  # False: nobody can connect; the bridge itself dials its console
    console: ConsoleAccess | None = None  # the console that the bridge dials; None: it dials none
    event_log: Path | None = None  # JSON lines of everything that happens to events; None writes nothing
    state_dir: Path | None = None  # keeps the latched stop over restarts; None: in memory only, and feedback says so
    older_state_dirs: tuple[Path, ...] = ()  # their state is used if `state_dir` is new
    lockout_file: Path | None = None  # while it exists, the robot is locked; None: no switch file
    first_event: int = FIRST_EVENT  # tests start near the wrap
    max_links: int = 32  # admitted links
    max_strangers: int = (
        128  # connections in each stage before admission; of more, the busiest address loses its oldest
    )
    operator_grace: float = 10.0  # s that a broken operator link is kept for the client of the same name
    secret: LinkSecret | None = None  # the secret that clients have to know
    tls: LinkTls | None = None
    insecure: bool = False  # listen beyond loopback although any client could drive
    event_strip: bool = False  # draw each picture's event into raw pictures, for tests and measurements
    encode: EncodeSettings | None = None  # encode pictures beside the robot; None: send them as the sources make them
    log_interval: float = 60.0  # s between log lines with the counters
