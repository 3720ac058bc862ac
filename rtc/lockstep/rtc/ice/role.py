"""The role of an agent: the controlling one decides on the path (RFC 8445 4). Settles conflicts of roles (7.3.1.1)."""

from dataclasses import dataclass
from random import Random

from lockstep.rtc.stun import Message

__all__ = ["Role"]


@dataclass(slots=True)
class Role:
    controlling: bool
    tie_breaker: int  # 64 random bits

    def conflicts(self, request: Message) -> bool:
        """True if the peer claims the same role."""
        return (request.controlling if self.controlling else request.controlled) is not None

    def keeps_against(self, request: Message) -> bool:
        """True if, in a conflict, this agent keeps its role and the peer has to change (RFC 8445 7.3.1.1)."""
        theirs = request.controlling if self.controlling else request.controlled
        # The greater tie-breaker controls; of equal ones, the agent that is asked.
        return (self.tie_breaker >= (theirs or 0)) is self.controlling

    def switch(self) -> None:
        self.controlling = not self.controlling

    def told_to_switch(self, rng: Random) -> None:
        """Switch the role: the peer answered 487 and has the greater claim (RFC 8445 7.2.5.1)."""
        self.switch()
        self.tie_breaker = rng.getrandbits(64)
