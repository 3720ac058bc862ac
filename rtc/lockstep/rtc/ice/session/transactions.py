"""A STUN transaction (RFC 8489 6.2): its request, its repetitions, and the time until which an answer counts."""

from dataclasses import dataclass

from lockstep.rtc.addresses import Path
from lockstep.rtc.ice.check_list import Pair
from lockstep.rtc.ice.settings import IceSettings

__all__ = ["Transaction"]


@dataclass(slots=True, eq=False)
class Transaction:
    """One Binding request on its way."""

    id: bytes
    data: bytes
    pair: Pair
    controlling: bool  # the role that it states
    nominates: bool  # it has USE-CANDIDATE, so that an answer decides
    sent_at: float  # the time of the first sending
    expires_at: float  # the time until which an answer counts
    repeat_at: float | None = None  # None: never again
    last_sent_at: float = 0.0
    wait: float = 0.0  # before the next repetition
    sent: int = 1

    @property
    def path(self) -> Path:
        return self.pair.path

    @property
    def due_at(self) -> float:
        return self.expires_at if self.repeat_at is None else min(self.repeat_at, self.expires_at)

    def begin(self, rto: float, settings: IceSettings) -> None:
        """Begin a connectivity check: repeat it on UDP (RFC 8489 6.2.1), wait as long on TCP (6.2.2)."""
        self.expires_at = self.sent_at + rto * (2 ** (settings.transmissions - 1) - 1 + settings.last_wait)
        if self.path.transport == "udp" and settings.transmissions > 1:
            self.wait = rto
            self.repeat_at = self.sent_at + rto

    def repeated(self, now: float, settings: IceSettings) -> None:
        """Note that the request was sent once more.

        Each wait is twice the one before. A nomination goes on at an even pace: its path is known to work, and the peer
        waits for it.
        """
        self.sent += 1
        self.last_sent_at = now
        if self.nominates:
            self.repeat_at = now + self.wait
        else:
            self.wait *= 2
            self.repeat_at = now + self.wait if self.sent < settings.transmissions else None
