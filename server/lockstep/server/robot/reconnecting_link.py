"""Keeps one robot link: connects, reads, and connects again when it breaks."""

import asyncio
from collections import Counter
from functools import partial
from typing import Protocol

import structlog

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.errors import LinkError, LinkLost
from lockstep.protocol.messages import LinkMessage, LinkRole
from lockstep.robot_bridge.link.link_client import RobotLink
from lockstep.server.robot.credentials import RobotLinkCredentials
from lockstep.server.robot.dial_in import DialIn
from lockstep.server.util.backoff import Backoff
from lockstep.server.util.cooperative_scheduler import turns_of_loop
from lockstep.server.util.uncancelled import attempt

__all__ = ["ReconnectingRobotLink", "RobotLinkSink"]

log = structlog.get_logger(__name__)

HEALTHY_AFTER = 5.0  # s up; then the next loss is retried soon again
FAULT = "internal_error: this console failed on a message of the robot"


class RobotLinkSink(Protocol):
    """Takes the events of a link. `link_closed` also follows a try that failed, with the reason; `link_failed` comes
    before it if one of these methods raised `error`."""

    def link_opened(self, role: LinkRole, epoch: str, description: RobotDescription) -> None: ...
    def link_closed(self, role: LinkRole, detail: str) -> None: ...
    def link_received(self, role: LinkRole, message: LinkMessage) -> None: ...
    def link_failed(self, role: LinkRole, error: Exception) -> None: ...


class ReconnectingRobotLink:
    """One link to the robot. An exception of the sink ends this link alone, which then connects again."""

    def __init__(
        self,
        host: str,
        port: int,
        role: LinkRole,
        sink: RobotLinkSink,
        backoff: Backoff,
        access: RobotLinkCredentials,
        name: str = "console",
        dial_in: DialIn | None = None,
    ) -> None:
        """`name`: tells the bridge for which console it keeps the robot after a link broke.

        `dial_in`: where the robot connects to this console; None: the console connects to `host`.
        """
        self._dial_in = dial_in
        self._name = name
        self._access = access
        self._host = host
        self._port = port
        self._role: LinkRole = role
        self._sink = sink
        self._backoff = backoff
        self._link: RobotLink | None = None  # None while down
        self._bad_input: Counter[str] = Counter()  # of links that ended
        self._drops: Counter[str] = Counter()

    def send(self, message: LinkMessage) -> bool:
        """Send a message. Return whether a link that is up took it."""
        if self._link is None:
            return False
        try:
            self._link.send(message)
        except LinkError:
            return False
        return True

    @property
    def encodes(self) -> bool:
        """True if the link is up and its bridge encodes media as it is asked to."""
        return self._link is not None and bool(self._link.hello.encodes)

    @property
    def makes_second(self) -> bool:
        """True if the link is up and its bridge makes a second encoding of a camera for those who ask."""
        return self._link is not None and self._link.hello.encodings >= 2

    def bad_input(self) -> Counter[str]:
        """Return the counts of messages that could not be read, by name of the error, on all links so far."""
        return self._bad_input + (self._link.bad_input if self._link is not None else Counter())

    def drops(self) -> Counter[str]:
        """Return the counts of messages that came faster than they were read on all links so far, by kind or stream."""
        if self._link is None:
            return self._drops
        return self._drops + self._link.drops + self._link.media_drops

    async def run(self) -> None:
        """Run until cancelled."""
        while True:
            try:
                await attempt(self._once())
            except LinkError as error:
                self._sink.link_closed(self._role, error.detail)
            except Exception as error:
                self._sink.link_failed(self._role, error)
                self._sink.link_closed(self._role, FAULT)
            await asyncio.sleep(self._backoff.next())

    async def _next(self) -> RobotLink:
        """Return the next link, not connected yet. Waits for a robot that dials in."""
        secret, tls = self._access
        if self._dial_in is None:
            return RobotLink(self._host, self._port, self._role, name=self._name, secret=secret, tls=tls)
        self._sink.link_closed(self._role, self._dial_in.words)
        while True:
            line = await self._dial_in.next_line(self._role)
            key = self._dial_in.key
            if key is not None:
                return RobotLink(line.address, 0, self._role, name=self._name, secret=key, connect=line.carry)
            line.close()  # forgotten meanwhile; a link without a key would ask the robot for no proof

    async def _once(self) -> None:
        loop = asyncio.get_running_loop()
        async with await self._next() as link:
            hello, since = link.hello, loop.time()
            if hello.description is None:
                raise LinkLost("the bridge sent no description")
            log.info("robot link up", role=self._role, epoch=hello.epoch)
            self._link = link
            try:
                self._sink.link_opened(self._role, hello.epoch, hello.description)
                turns_of_loop().yield_to(link)
                await link.deliver(partial(self._sink.link_received, self._role))
            finally:
                self._link = None
                self._bad_input += link.bad_input
                self._drops += link.drops + link.media_drops
                if loop.time() - since > HEALTHY_AFTER:
                    self._backoff.healthy()
        raise LinkLost("the link was closed")
