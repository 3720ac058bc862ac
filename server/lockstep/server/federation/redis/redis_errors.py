"""Turns exceptions of redis-py into errors of the board."""

from collections.abc import Iterator
from contextlib import contextmanager

from redis.exceptions import (
    AuthenticationError,
    AuthorizationError,
    NoPermissionError,
    OutOfMemoryError,
    ReadOnlyError,
    RedisError,
    ResponseError,
)
from redis.exceptions import TimeoutError as RedisTimeout

from lockstep.server.federation.errors import (
    BoardFull,
    BoardRefused,
    BoardSilent,
    BoardTrouble,
    BoardUnreachable,
    BoardWrongType,
    InputTooLarge,
)
from lockstep.server.federation.redis.redis_private import AnswerTooLarge

__all__ = ["RedisErrors"]


class RedisErrors:
    """The errors of one Redis, without its password. `timeout`: s for one exchange."""

    def __init__(self, password: str, timeout: float) -> None:
        self._password = password
        self._timeout = timeout

    @contextmanager
    def named(self) -> Iterator[None]:
        """Raise exceptions of the block as BoardTrouble, or as InputTooLarge."""
        try:
            yield
        except (TimeoutError, RedisTimeout) as error:
            raise BoardSilent(f"Redis did not answer within {self._timeout:g} s") from error
        except AnswerTooLarge as error:
            raise InputTooLarge(str(error)) from error
        except (AuthenticationError, AuthorizationError, NoPermissionError) as error:
            raise BoardRefused(self._words(error)) from error
        except (OutOfMemoryError, ReadOnlyError) as error:
            raise BoardFull(self._words(error)) from error
        except ResponseError as error:
            raise self._refusal(str(error)) from error
        except (RedisError, OSError) as error:
            raise BoardUnreachable(self._words(error)) from error

    def _refusal(self, text: str) -> BoardTrouble:
        kind = text.split(" ", 1)[0]
        if kind == "WRONGTYPE":
            return BoardWrongType("a key of this console holds another kind of value")
        if kind in ("OOM", "MISCONF", "READONLY"):
            return BoardFull(self._words(text))
        return BoardRefused(self._words(text))

    def _words(self, error: object) -> str:
        text = str(error)[:200]
        return text.replace(self._password, "…") if self._password else text
