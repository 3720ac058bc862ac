"""The flags of --teleop.type=lockstep."""

from dataclasses import dataclass, field

from lerobot.teleoperators.config import TeleoperatorConfig

__all__ = ["LockstepTeleoperatorConfig"]

SOURCES = ("session", "page")
DEGREES: dict[str, float | str] = {"unit": "deg", "slew": 60.0, "reach": 30.0}
# An SO-101 follower in LeRobot's degrees; its calibration may allow less.
SO101: dict[str, dict[str, float | str]] = {
    "shoulder_pan.pos": {"minimum": -110.0, "maximum": 110.0, **DEGREES},
    "shoulder_lift.pos": {"minimum": -100.0, "maximum": 100.0, **DEGREES},
    "elbow_flex.pos": {"minimum": -97.0, "maximum": 97.0, **DEGREES},
    "wrist_flex.pos": {"minimum": -95.0, "maximum": 95.0, **DEGREES},
    "wrist_roll.pos": {"minimum": -157.0, "maximum": 157.0, **DEGREES},
    "gripper.pos": {"minimum": 0.0, "maximum": 100.0, "unit": "%", "slew": 100.0, "reach": 100.0},
}


@TeleoperatorConfig.register_subclass("lockstep")
@dataclass(kw_only=True)
class LockstepTeleoperatorConfig(TeleoperatorConfig):
    """A person at Lockstep's page leads."""

    # "session": the goals that a person drives a Lockstep robot with, to be recorded with --robot.type=lockstep and
    # --robot.drive=false. "page": this process is the robot of a console, and leads a robot of LeRobot.
    source: str = "session"  # LeRobot's flags have no Literal
    # The Python that has Lockstep. "": LOCKSTEP_PYTHON
    python: str = ""

    # For "session": the link of the console, an observer's is enough. "": LOCKSTEP_LINK
    link: str = ""
    tls_ca: str | None = None
    observation_timeout_s: float = 2.0
    connect_timeout_s: float = 30.0

    # For "page": where the bridge listens for its console; LOCKSTEP_LINK_SECRET is the secret between them.
    host: str = "127.0.0.1"
    port: int = 5600
    # The axes by the robot's names: minimum, maximum, unit, slew, reach. Those of an SO-101 unless given.
    axes: dict[str, dict[str, float | str]] = field(default_factory=lambda: dict(SO101))
    # Where the leader is at first: where the robot stands, or it goes there as soon as LeRobot begins.
    start: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.source not in SOURCES:
            raise ValueError(f"source is {' or '.join(SOURCES)}, not {self.source!r}")
