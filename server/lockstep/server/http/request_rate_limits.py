"""Rate limits of offers and of requests without a valid token, behind the trusted-host middleware."""

import time
from collections.abc import Callable

from starlette.types import Scope

from lockstep.server.errors import TooManyRequests
from lockstep.server.http.limit_settings import LimitSettings
from lockstep.server.http.trusted_host import client_address
from lockstep.server.util.rate_limits import RateLimits

__all__ = ["RequestRateLimits"]


class RequestRateLimits:
    """Counts offers by token and failures by address."""

    def __init__(self, settings: LimitSettings, clock: Callable[[], float] = time.monotonic) -> None:
        self._offers = RateLimits(settings.max_offer_rate, settings.max_offer_burst)
        self._failures = RateLimits(settings.max_refused_rate, settings.max_refused_burst)
        self._clock = clock

    def offer(self, token_id: str) -> None:
        """Count an offer. Raises TooManyRequests."""
        if not self._offers.spend(token_id, self._clock()):
            raise TooManyRequests("too many offers with this link")

    def may_fail(self, scope: Scope) -> bool:
        """Count a request without a valid token; False when its address has had too many."""
        return self._failures.spend(client_address(scope), self._clock())
