"""The connections that wait for the bridge's answer to a press of STOP. No I/O, no clock."""

from collections.abc import Callable

__all__ = ["MAX_LISTENERS", "PressListeners"]

MAX_LISTENERS = 16  # connections that are told of one press


class PressListeners:
    def __init__(self) -> None:
        self._waiting: dict[str, list[tuple[str, str]]] = {}  # press -> (waiting peer, id that it knows)

    def add(self, press: str, peer: str, told: str) -> None:
        """Add `peer`, which knows the press by the id `told`. Nothing is added for a press over HTTP, with peer ""."""
        if not peer:
            return
        waiting = self._waiting.setdefault(press, [])
        if (peer, told) not in waiting and len(waiting) < MAX_LISTENERS:
            waiting.append((peer, told))

    def take(self, press: str) -> list[tuple[str, str]]:
        """Remove those who wait for this press; return each peer with the id that it knows."""
        return self._waiting.pop(press, [])

    def keep(self, is_pending: Callable[[str], bool]) -> None:
        """Forget presses that are no longer pending."""
        self._waiting = {press: peers for press, peers in self._waiting.items() if is_pending(press)}
