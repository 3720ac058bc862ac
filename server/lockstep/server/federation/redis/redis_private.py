"""Bounds the answers that redis-py reads from the server. The only module that uses private parts of redis-py.

A writer to the store can put half a gigabyte where a console expects a line, and redis-py reads any length that the
server announces. `tests/server/federation/test_redis_private.py` fails when an upgrade moves these parts.
"""

from redis._parsers.resp2 import _AsyncRESP2Parser
from redis.exceptions import InvalidResponse

__all__ = ["LARGEST", "AnswerTooLarge", "BoundedParser"]

LARGEST = 512 * 1024  # bytes of one string


class AnswerTooLarge(InvalidResponse):
    pass


class BoundedParser(_AsyncRESP2Parser):
    """Gives the connection up instead of reading a string longer than any that a console writes."""

    async def _read(self, length: int) -> bytes:
        if length > LARGEST:
            raise AnswerTooLarge(f"a string of {length} bytes")
        return await super()._read(length)
