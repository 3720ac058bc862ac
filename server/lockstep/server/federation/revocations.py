"""Shares revoked links through the board: a link that one console revokes opens no other."""

import asyncio
import time
from collections.abc import Callable, Mapping
from typing import Protocol

import structlog

from lockstep.server.auth.invitations import Invitation
from lockstep.server.federation.envelope import Seal
from lockstep.server.federation.errors import BoardError, BoardInput, BoardSilent, BoardUnreachable
from lockstep.server.federation.messages import Revoked, RevokedLink, pack_news, pack_revoked, unpack_revoked
from lockstep.server.util.state_dir import StateDirUnusable
from lockstep.server.util.uncancelled import in_thread

__all__ = ["KnownLinks", "RevocationStore", "Revocations"]

log = structlog.get_logger(__name__)

LOOK_SECONDS = 10.0  # until the list is read again without news of a change


class KnownLinks(Protocol):
    """The invitations of this console."""

    on_revoked: Callable[[], None]

    def revoked_links(self) -> dict[str, float]: ...
    def revoked_elsewhere(self, links: Mapping[str, float]) -> bool: ...
    def keep_revoked_elsewhere(self) -> list[Invitation]: ...


class RevocationStore(Protocol):
    async def revoke(self, links: list[tuple[bytes, float]], news: bytes, now: float) -> None: ...
    async def revoked(self) -> list[bytes]: ...


class Revocations:
    """Call `listen` once, `begin` with each new connection and `exchange` again and again."""

    def __init__(self, links: KnownLinks, seal: Seal, console: str) -> None:
        self._links = links
        self._seal = seal
        self._console = console
        self._told: set[str] = set()  # known links that the store has
        self._seen: set[bytes] = set()  # entries of the store that were read
        self._look_at = 0.0  # time of the next look at the list

    def listen(self, wake: Callable[[], None]) -> None:
        """Call `wake` on this loop when a link was revoked here."""
        loop = asyncio.get_running_loop()

        def revoked() -> None:
            if not loop.is_closed():
                loop.call_soon_threadsafe(wake)

        self._links.on_revoked = revoked

    def begin(self) -> None:
        """Start anew: the store may have lost everything, and this console may have missed news."""
        self._told.clear()
        self.look()

    def look(self) -> None:
        self._look_at = 0.0

    async def exchange(self, store: RevocationStore, count: Callable[[BoardError], None]) -> list[Invitation] | None:
        """Share links that were revoked here, and learn those that were revoked elsewhere.

        Returns this console's invitations that end with them; None when there is no news.

        Raises:
            BoardSilent, BoardUnreachable: no answer in time, or no connection; other errors are counted.
        """
        try:
            await self._tell(store)
            now = time.monotonic()
            if now < self._look_at:
                return None
            entries = await store.revoked()
        except (BoardSilent, BoardUnreachable):
            raise
        except BoardError as error:
            count(error)
            return None
        self._look_at = now + LOOK_SECONDS
        return await self._learn(entries, count)

    async def _tell(self, store: RevocationStore) -> None:
        now = time.time()
        fresh = {
            link: expires
            for link, expires in self._links.revoked_links().items()
            if link not in self._told and expires > now
        }
        if not fresh:
            return
        sealed = [
            (pack_revoked(self._seal, RevokedLink(id=link, expires=expires)), expires)
            for link, expires in fresh.items()
        ]
        await store.revoke(sealed, pack_news(self._seal, Revoked(console=self._console)), now)
        self._told |= fresh.keys()

    async def _learn(self, entries: list[bytes], count: Callable[[BoardError], None]) -> list[Invitation] | None:
        found: dict[str, float] = {}
        for sealed in entries:
            if sealed in self._seen:
                continue
            try:
                link = unpack_revoked(self._seal, sealed)
            except BoardInput as error:
                count(error)
                continue
            found[link.id] = link.expires
        self._seen = set(entries)
        self._told |= found.keys()
        known = self._links.revoked_links()
        if not self._links.revoked_elsewhere({link: expires for link, expires in found.items() if link not in known}):
            return None
        try:
            return await in_thread(self._links.keep_revoked_elsewhere)
        except StateDirUnusable as error:
            log.error("revocations by other consoles are in memory only and end with this console", detail=str(error))
            return []
