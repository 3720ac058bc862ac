"""Reads request bodies up to a bound, before anything else looks at them."""

import asyncio
from functools import cache
from typing import TypeVar

import msgspec
from fastapi import Request
from starlette.requests import ClientDisconnect

from lockstep.server.errors import BadJson, BodyTooLarge, BodyTooSlow, WrongMediaType
from lockstep.server.http.transport.uvicorn_http_limits import DEADLINE

__all__ = ["deadline", "media_type", "read_json", "read_text"]

MAX_JSON = 4096  # bytes

Body = TypeVar("Body", bound=msgspec.Struct)


def media_type(request: Request) -> str:
    return request.headers.get("content-type", "").partition(";")[0].strip().lower()


async def read_text(request: Request, expected: str, bound: int) -> str:
    """Return the body as text.

    Raises:
        WrongMediaType: it is not declared as `expected`, or it is not UTF-8.
        BodyTooLarge: longer than `bound` bytes; reading stops there.
        BodyTooSlow: it does not come in time.
    """
    if media_type(request) != expected:
        raise WrongMediaType(f"the Content-Type has to be {expected}")
    try:
        return (await _read(request, bound)).decode()
    except UnicodeDecodeError as error:
        raise WrongMediaType("the body is not UTF-8") from error


@cache  # filled on the loop alone: two threads that meet a type for the first time crash in msgspec 0.22
def _decoder(kind: type[Body]) -> msgspec.json.Decoder[Body]:
    return msgspec.json.Decoder(kind)


async def read_json(request: Request, kind: type[Body]) -> Body:
    """Return the body as `kind`; an empty body counts as an empty object.

    Raises:
        BadJson: not JSON, or a field of the wrong type.
        BodyTooLarge: longer than MAX_JSON.
    """
    body = await _read(request, MAX_JSON)
    try:
        found: Body = _decoder(kind).decode(body or b"{}")
    except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
        raise BadJson(str(error)) from error
    return found


async def _read(request: Request, bound: int) -> bytes:
    body = bytearray()
    try:
        async with asyncio.timeout_at(deadline(request)):
            async for chunk in request.stream():
                body += chunk
                if len(body) > bound:
                    raise BodyTooLarge(f"the body has more than {bound} bytes")
    except TimeoutError as error:
        raise BodyTooSlow("the body did not arrive in time") from error
    except ClientDisconnect as error:
        raise BodyTooSlow("the connection ended before the whole body arrived") from error
    return bytes(body)


def deadline(request: Request) -> float:
    """Return the deadline on the loop's clock: for head and body together, if the connection measures them."""
    found = request.scope.get("state", {}).get(DEADLINE)
    if isinstance(found, float):
        return found
    timeout: float = request.app.state.settings.request_timeout
    return asyncio.get_running_loop().time() + timeout
