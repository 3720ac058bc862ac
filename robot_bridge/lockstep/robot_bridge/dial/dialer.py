"""Keeps a robot's two links to its console open: for commands, and for pictures and sound. Tries for ever."""

import asyncio
import contextlib
import logging
import random
import ssl

from websockets.exceptions import ConnectionClosed

from lockstep.protocol.dial_in import OWN_LINK_ENDS, TRUSTED, WAIT_HEADER, WAITS, RobotToken
from lockstep.protocol.messages import LinkRole
from lockstep.robot_bridge.dial.console_access import ConsoleAccess
from lockstep.robot_bridge.dial.console_connection import ConsoleConnection, console_context, open_connection
from lockstep.robot_bridge.dial.redial_times import RedialTimes
from lockstep.robot_bridge.errors import BridgeError, ConsoleRefused, WrongConsole
from lockstep.robot_bridge.link.link_server import LinkPeer, LinkServer

__all__ = ["Dialer"]

ROLES: tuple[LinkRole, ...] = ("operator", "media")
PING_SECONDS, MOST_PINGS = 0.1, 30  # while a link is not admitted; a console may let it wait for long
HEALTHY_AFTER = 5.0  # s of a link; then the next loss is followed by a try at once
TAKEN = (
    "the console has another connection with this robot's key, and takes this one when that ends: a second robot with"
    " the same key, or a copy of its state directory, may be running"
)
MOST_SAID = 16  # different troubles of a link; after more they are told anew
DENIED = (401, 403, 409)  # statuses that only a person ends: not paired, forgotten, not a console for dialling

_logger = logging.getLogger(__name__)


class Dialer:
    """Dials; everything after that is as on every link: the console says hello, both prove that they know the key.

    No fault of the console or of the path ends the robot: it comes to rest as when any link is lost.
    """

    def __init__(self, access: ConsoleAccess, links: LinkServer, jitter: random.Random | None = None) -> None:
        """Raises SecretError: the authority's file cannot be used."""
        self._access = access
        self._links = links
        self._jitter = jitter or random.Random()
        self._context: ssl.SSLContext | None = None
        if access.address.is_encrypted:
            self._context = console_context(access.key.pin, access.authority)
        self._expected = access.key.pin if self._context is not None and access.key.pin != TRUSTED else None
        self._leaving = False
        # What the log has of each link since it was connected.
        self._said: dict[LinkRole, set[str]] = {role: set() for role in ROLES}
        self._waits_since: dict[LinkRole, float] = {}  # loop time; a wait goes on over many tries

    async def run(self) -> None:
        """Run until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            for role in ROLES:
                tasks.create_task(self._keep(role), name=f"dial {role}")

    def leave(self) -> None:
        """Dial no more; links that are open go on."""
        self._leaving = True

    async def _keep(self, role: LinkRole) -> None:
        times, loop = RedialTimes(self._jitter), asyncio.get_running_loop()
        while not self._leaving:
            refused, since = False, loop.time()
            try:
                await self._once(role, times.patience())
                if loop.time() - since > HEALTHY_AFTER:
                    times.healthy()
            except BridgeError as error:
                self._waits_since.pop(role, None)
                refused = isinstance(error, WrongConsole) or (
                    isinstance(error, ConsoleRefused) and error.status in DENIED
                )
                self._say(role, str(error))
            except Exception as error:  # a fault here must not end the robot's bridge
                _logger.error("dialling the console failed: %r", error, exc_info=error)
            await asyncio.sleep(times.wait(refused=refused))

    async def _once(self, role: LinkRole, patience: float) -> None:
        key = self._access.key.key
        connection = await open_connection(
            self._access.address.path(role),
            self._context,
            expected=self._expected,
            headers={"Authorization": RobotToken.of(key).header},
            seconds=patience,
            for_link=True,
        )
        try:
            link = self._links.dialled_link(key)
            connection.carry(link)
            async with asyncio.TaskGroup() as tasks:
                saying = tasks.create_task(self._say_reached(role, link, _waits(connection)), name=f"dialled {role}")
                asking = tasks.create_task(_ask(connection, link), name=f"pings of {role}")
                await connection.ended.wait()
                saying.cancel()
                asking.cancel()
        finally:
            connection.transport.abort()

    async def _say_reached(self, role: LinkRole, link: LinkPeer, waits: bool) -> None:
        """Log that a link has reached the console; of a link that waits there for long, that it does. Is cancelled."""
        if waits and not link.admitted.is_set():
            since = self._waits_since.setdefault(role, asyncio.get_running_loop().time())
            try:
                async with asyncio.timeout_at(since + OWN_LINK_ENDS):
                    await link.admitted.wait()
            except TimeoutError:
                self._say(role, TAKEN)
                await link.admitted.wait()
        self._waits_since.pop(role, None)
        self._say(role, "")

    def _say(self, role: LinkRole, trouble: str) -> None:
        """Log a trouble of a link once until it is connected again, and that it is."""
        said = self._said[role]
        if trouble in said:
            return
        if not trouble or len(said) > MOST_SAID:
            said.clear()
        said.discard("")
        said.add(trouble)
        if trouble == TAKEN:
            _logger.warning("the %s link waits: %s", role, trouble)
        elif trouble:
            _logger.warning("the %s link does not reach the console, trying on: %s", role, trouble)
        else:
            _logger.info("the %s link has reached the console at %s", role, self._access.address.url)


async def _ask(connection: ConsoleConnection, link: LinkPeer) -> None:
    """Ping behind the link's handshake until it is admitted.

    Nothing else follows the handshake's messages, so TCP would repeat a lost one only by its timer, of half a second
    and more on a long path. A ping and its answer show the loss on either way within a round trip.
    """
    with contextlib.suppress(ConnectionClosed):
        for _ in range(MOST_PINGS):
            await asyncio.sleep(PING_SECONDS)
            if link.admitted.is_set():
                return
            await connection.ping()


def _waits(connection: ConsoleConnection) -> bool:
    """Return whether the console's answer says so. Older consoles do not; `get_all` takes a header that came twice."""
    response = connection.response
    return response is not None and response.headers.get_all(WAIT_HEADER) == [WAITS]
