"""Where a robot comes in that dials its console: one robot, its two connections, and how it is paired and forgotten."""

import asyncio
import secrets
import time
from collections.abc import Callable
from typing import Protocol

import structlog

from lockstep.protocol.dial_in import (
    SALT_BYTES,
    PairingCode,
    PairingSecret,
    RobotToken,
)
from lockstep.protocol.link_secret import LinkSecret
from lockstep.protocol.messages import LinkRole
from lockstep.server.robot.paired_robot import PairedRobot, forget_paired, load_paired, save_paired
from lockstep.server.robot.pairing_offer import Exchange, Paired, PairingOffer, Refusal
from lockstep.server.robot.second_connection import SecondConnection
from lockstep.server.robot.waiting_robots import WaitingRobots, WaitReason
from lockstep.server.util.state_dir import StateDir, StateDirUnusable
from lockstep.server.util.uncancelled import in_thread

__all__ = ["DIAL_IN", "DialIn", "RobotLine"]

log = structlog.get_logger(__name__)

DIAL_IN = "dial-in"  # instead of a robot's address
WAITING = "waiting for the robot to dial in"
UNPAIRED = "no robot is paired; a supervisor presses “Pair a robot”"
NO_TOKEN = RobotToken(secrets.token_hex(32))  # fits no robot: a request is compared even while none is paired


class RobotLine(Protocol):
    """A connection that a robot has opened to this console, and that carries one link."""

    @property
    def address(self) -> str: ...
    @property
    def is_closed(self) -> bool: ...

    def carry(self, link: asyncio.Protocol) -> None: ...
    def close(self) -> None: ...


class DialIn:
    """The place of one robot. Everything is called on the loop.

    Attributes:
        offer: the pairing code that is open
        paired: the robot; None before one was paired, and with a key from the settings
        trouble: why the state cannot be read; then no robot comes in
        exchanges: robots that pair at this moment
        waits: the robots that called and were not let in
    """

    def __init__(
        self,
        directory: StateDir,
        given: LinkSecret | None,
        own_pin: Callable[[], str | None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """`given`: the key that the settings name; with it nothing is paired. `own_pin` may wait for the disk."""
        self.offer = PairingOffer()
        self.paired: PairedRobot | None = None
        self.trouble = ""
        self.exchanges = 0
        self.waits = WaitingRobots()
        self._directory = directory
        self._given = given
        self._own_pin = own_pin
        self._clock = clock
        self._arrived: dict[LinkRole, RobotLine] = {}  # that wait for their link
        self._carrying: dict[LinkRole, RobotLine] = {}
        self._second = SecondConnection()
        self._news = asyncio.Event()
        self._changing = asyncio.Lock()
        self._by = ""  # who has opened the code
        if given is None:
            try:
                self.paired = load_paired(directory)
            except StateDirUnusable as error:
                self.trouble = str(error)
                log.error("the paired robot is unknown, so no robot comes in", detail=str(error))

    @property
    def has_given_key(self) -> bool:
        return self._given is not None

    @property
    def key(self) -> LinkSecret | None:
        if self._given is not None:
            return self._given
        return None if self.paired is None else self.paired.key

    @property
    def address(self) -> str:
        """Where the robot is connected from; "" while it is away."""
        return self._carrying["operator"].address if self.is_taken("operator") else ""

    @property
    def words(self) -> str:
        """Why there is no link, for people."""
        return self.trouble or (UNPAIRED if self.key is None else WAITING)

    # Connections

    def knows(self, authorization: str) -> bool:
        """Return whether a request is of the paired robot. Compares in constant time."""
        key = self.key
        fits = (NO_TOKEN if key is None else RobotToken.of(key)).fits(authorization)
        return fits and key is not None

    def arrived(self, role: LinkRole, line: RobotLine) -> None:
        """Take a connection of the robot. A newer one replaces one that waits: the robot has given that up."""
        if role == "operator" and self.is_taken(role):
            self._second_arrived(line)
        before = self._arrived.get(role)
        if before is not None:
            before.close()
        self._arrived[role] = line
        self._news.set()

    def _second_arrived(self, line: RobotLine) -> None:
        """Tell people of an operator connection that waits while another one has the place."""
        if self._second.is_news(self._clock()):
            text = "another connection with the robot's key waits: a second robot, or a copy of its key, may be running"
            log.warning(text, waits=line.address, connected=self.address)
        if self._second.lasts:
            self.refused(line.address, "taken")

    def refused(self, address: str, why: WaitReason, name: str = "") -> None:
        """Note a robot that called and was not let in. `name`: as it calls itself; "" if this try does not say."""
        self.waits.called(address, why, name, self._clock(), time.time())

    def is_taken(self, role: LinkRole) -> bool:
        """Return whether a connection carries this link, so that another one waits for its end."""
        line = self._carrying.get(role)
        return line is not None and not line.is_closed

    async def next_line(self, role: LinkRole) -> RobotLine:
        """Wait for the next connection for this link."""
        while True:
            line = self._arrived.pop(role, None)
            if line is not None and not line.is_closed:
                self._carrying[role] = line
                if role == "operator":
                    self._second = SecondConnection()
                    self.waits.admitted(line.address)
                return line
            self._news.clear()
            await self._news.wait()

    def _end_lines(self) -> None:
        for line in (*self._arrived.values(), *self._carrying.values()):
            line.close()
        self._arrived.clear()
        self._carrying.clear()

    # Pairing

    async def open_code(self, by: str) -> PairingCode:
        """Make a code, which replaces any other. `by`: the person, for the list."""
        code, salt = PairingCode.draw(), secrets.token_bytes(SALT_BYTES)
        secret = await asyncio.to_thread(PairingSecret, code, salt)
        self.offer.offer(code, salt, secret, self._clock())
        self._by = by
        return code

    async def prove(self, exchange: Exchange, proof: bytes) -> Paired | Refusal:
        """Judge a robot's proof; keep the robot before it is answered. Raises StateDirUnusable."""
        pin = await in_thread(self._own_pin)
        outcome = self.offer.prove(exchange, proof, pin, self._clock())
        if isinstance(outcome, Paired):
            paired = PairedRobot(outcome.key, outcome.robot, self._by, time.time())
            async with self._changing:
                await in_thread(lambda: save_paired(self._directory, paired))
                self._end_lines()
                self.paired, self.trouble = paired, ""
        return outcome

    async def forget(self) -> None:
        """Forget the robot: its links end now, and it does not come in again.

        Raises:
            StateDirUnusable: forgotten until the console restarts; the disk does not take it.
        """
        self.paired = None
        self.offer.withdraw()
        self._end_lines()
        async with self._changing:
            self.paired = None
            self._end_lines()
            await in_thread(lambda: forget_paired(self._directory))
            self.trouble = ""
