"""Decides which links are admitted, and knows those that are, by role. No I/O, no clock: the caller hands in `now`."""

import math
from collections.abc import Hashable
from typing import Generic, TypeVar

from lockstep.protocol.messages import Goodbye, Hello

__all__ = ["LinkAdmission"]

Link = TypeVar("Link", bound=Hashable)


class LinkAdmission(Generic[Link]):
    """The admitted links. Call `refuses` with each hello, then `add`; `remove` when a link has ended.

    Attributes:
        operator: the operator link; None without one
        events: links that get every event's number
        media: links that get pictures and sound
    """

    def __init__(self, *, max_links: int, operator_grace: float) -> None:
        """`operator_grace`: s that a broken operator link is kept for the client of the same name."""
        self.operator: Link | None = None
        self.events: set[Link] = set()
        self.media: set[Link] = set()
        self._max_links = max_links
        self._operator_grace = operator_grace
        self._kept_for = ""  # name of the client whose operator link broke; "" if none has
        self._kept_until = -math.inf  # s, end of that client's grace

    def refuses(self, hello: Hello, now: float) -> Goodbye | None:
        """Return why the link is not admitted; None: it may be added."""
        if not self._has_room(hello):
            return Goodbye(error="full", detail=f"this bridge takes at most {self._max_links} links")
        if hello.role != "operator":
            return None
        if self.operator is not None:
            return Goodbye(error="taken", detail="another operator link is open")
        left = self._kept_until - now
        if self._kept_for not in ("", hello.name) and left > 0:  # a stall gives the robot to no other client
            return Goodbye(error="taken", detail=f"kept for {self._kept_for}, whose link broke, for {left:.0f} s more")
        return None

    def add(self, link: Link, hello: Hello) -> None:
        match hello.role:
            case "operator":
                self.operator = link
                self._kept_for = ""
            case "events":
                self.events.add(link)
            case _:
                self.media.add(link)

    def remove(self, link: Link, name: str, now: float, *, left: bool) -> bool:
        """Forget a link, admitted or not; return True if it was the operator link.

        `left`: the client ended it in order, so nothing is kept for it.
        """
        self.events.discard(link)
        self.media.discard(link)
        if self.operator != link:
            return False
        self.operator = None
        if not left:
            self._kept_for, self._kept_until = name, now + self._operator_grace
        return True

    def _has_room(self, hello: Hello) -> bool:
        """Return whether there is room for the link. The last place is the operator's.

        So a console comes back, no matter how many links others open.
        """
        others = len(self.events) + len(self.media)
        return others < (self._max_links if hello.role == "operator" else self._max_links - 1)
