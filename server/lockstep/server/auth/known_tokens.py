"""Tokens that were good a while ago. They give no right, only priority to requests."""

from collections import OrderedDict

__all__ = ["KnownTokens"]

MAX_TOKENS = 10_000


class KnownTokens:
    """The newest known tokens, bounded in number."""

    def __init__(self, most: int = MAX_TOKENS) -> None:
        self._most = most
        self._tokens: OrderedDict[str, None] = OrderedDict()

    def __contains__(self, token: str) -> bool:
        return token in self._tokens

    def add(self, token: str) -> None:
        self._tokens[token] = None
        self._tokens.move_to_end(token)
        if len(self._tokens) > self._most:
            self._tokens.popitem(last=False)

    def forget(self, token: str) -> None:
        """Forget a token that is no longer good: its sender is a stranger."""
        self._tokens.pop(token, None)
