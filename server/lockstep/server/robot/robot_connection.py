"""The console's connection to the robot: a link for commands and one for media, so that pictures delay no command."""

import asyncio
import random
import time
from collections import Counter
from pathlib import Path
from typing import Protocol

import msgspec
import structlog

from lockstep.protocol.actions import Act, ActionCancel
from lockstep.protocol.console import RobotState
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import (
    Command,
    EncodeRequest,
    Feedback,
    LinkMessage,
    LinkRole,
    Media,
    Reset,
    Rest,
    Stop,
)
from lockstep.server.robot.console_name import console_name
from lockstep.server.robot.credentials import RobotLinkSettings, link_access
from lockstep.server.robot.dial_in import DialIn
from lockstep.server.robot.reconnecting_link import ReconnectingRobotLink
from lockstep.server.telemetry.faults import Faults
from lockstep.server.util.backoff import Backoff

__all__ = ["MediaSink", "RobotConnection", "RobotHost", "RobotSettings"]

log = structlog.get_logger(__name__)

_ROLES: tuple[LinkRole, ...] = ("operator", "media")


class RobotSettings(RobotLinkSettings, Protocol):
    @property
    def robot_host(self) -> str: ...
    @property
    def robot_port(self) -> int: ...
    @property
    def link_backoff(self) -> float: ...
    @property
    def link_backoff_cap(self) -> float: ...
    @property
    def state_dir(self) -> Path | None: ...


class RobotHost(Protocol):
    """Takes the reports of the connection. All methods are called on the loop and return at once."""

    def epoch_began(self, epoch: str, description: RobotDescription) -> None: ...
    def robot_link_up(self) -> None: ...
    def robot_link_down(self, detail: str) -> None: ...
    def feedback_received(self, feedback: Feedback) -> None: ...
    def link_message_received(self, message: LinkMessage) -> None: ...  # neither feedback nor media


class MediaSink(Protocol):
    """Takes the robot's pictures and sound. Called on the loop, returns at once."""

    def feed(self, media: Media, now: float) -> None: ...


class RobotConnection:
    """`epoch_began` comes before `link_up`, and again whenever the bridge was restarted, whichever link sees it first.

    Attributes:
        epoch, description: of the bridge reached last; "" and None before the first
        up: True while the operator link is up
        reached: set while it is up
        detail: reason that it is down
    """

    def __init__(
        self,
        settings: RobotSettings,
        host: RobotHost,
        media: MediaSink,
        faults: Faults,
        dial_in: DialIn | None = None,
    ) -> None:
        """`dial_in`: where the robot connects to this console; None: the console connects to it."""
        self.epoch = ""
        self.description: RobotDescription | None = None
        self.reached = asyncio.Event()
        self.detail = "not connected yet"
        self._host = host
        self._media = media
        self._faults = faults
        self._epochs: dict[LinkRole, str] = {}  # of each link, open now or last
        access = link_access(settings)
        # A robot that dials in paces its tries itself, and is taken as soon as it comes.
        cap = settings.link_backoff_cap if dial_in is None else settings.link_backoff
        self._keepers = {
            role: ReconnectingRobotLink(
                settings.robot_host,
                settings.robot_port,
                role,
                self,
                Backoff(settings.link_backoff, cap, random.Random()),
                access,
                console_name(settings.state_dir),
                dial_in,
            )
            for role in _ROLES
        }

    @property
    def up(self) -> bool:
        return self.reached.is_set()

    def state(self) -> RobotState | None:
        """Return the state as everyone is told it; None before the robot was reached."""
        if self.description is None:
            return None
        return RobotState(
            link="up" if self.up else "down", epoch=self.epoch, description=self.description, detail=self.detail
        )

    async def run(self) -> None:
        """Run until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            for role, keeper in self._keepers.items():
                tasks.create_task(keeper.run(), name=f"robot link {role}")

    def send(self, message: Command | Rest | Reset | Act | ActionCancel) -> bool:
        """Send over the operator link. Return whether the link took the message."""
        return self._keepers["operator"].send(message)

    def send_stop(self, stop: Stop) -> bool:
        """Send over every link that is up, as `send`: TCP may repeat a lost packet on one of them for seconds."""
        sent = [keeper.send(stop) for keeper in self._keepers.values()]
        return any(sent)

    def ask_for_encoding(self, request: EncodeRequest) -> bool:
        """Tell a bridge that encodes how to. Return whether its link took the message; False for other bridges."""
        media = self._keepers["media"]
        if not media.makes_second:
            request = msgspec.structs.replace(request, second=[])
        return media.encodes and media.send(request)

    def bad_input(self) -> Counter[str]:
        """Return the counts of messages from the bridge that could not be read, by name of the error."""
        return sum((keeper.bad_input() for keeper in self._keepers.values()), Counter())

    def drops(self) -> Counter[str]:
        """Return the counts of messages from the bridge that came faster than they were read, by kind or stream."""
        return sum((keeper.drops() for keeper in self._keepers.values()), Counter())

    # Events of the links

    def link_opened(self, role: LinkRole, epoch: str, description: RobotDescription) -> None:
        self._epochs[role] = epoch
        if epoch != self.epoch:
            self.epoch, self.description = epoch, description
            self._host.epoch_began(epoch, description)
        if role == "operator":
            self.reached.set()
            self.detail = ""
            self._host.robot_link_up()

    def link_closed(self, role: LinkRole, detail: str) -> None:
        if role != "operator":
            return
        changed = self.up or detail != self.detail
        self.reached.clear()
        self.detail = detail
        if changed:
            log.warning("robot link down", detail=detail)
            self._host.robot_link_down(detail)

    def link_failed(self, role: LinkRole, error: Exception) -> None:
        self._faults.caught(f"robot link {role}", error)

    def link_received(self, role: LinkRole, message: LinkMessage) -> None:
        if self._epochs.get(role) != self.epoch:
            return  # last messages of the old bridge, while the other link has reached the new one already
        if isinstance(message, Media):
            self._media.feed(message, time.monotonic())
        elif isinstance(message, Feedback):
            self._host.feedback_received(message)
        else:
            self._host.link_message_received(message)
