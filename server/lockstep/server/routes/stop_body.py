"""Reads the body of a STOP over HTTP. Every body is a stop; fields that cannot be read are left out."""

import asyncio
from typing import Annotated

import msgspec
from fastapi import Request

from lockstep.server.errors import BodyTooSlow, RequestError, http_error
from lockstep.server.http.request_body import read_json
from lockstep.server.routes.error_responses import count_refused
from lockstep.server.stop.stop_presses import MAX_REASON, stop_text

__all__ = ["BODY_SECONDS", "StopRequest", "read_stop"]

BODY_SECONDS = 1.0  # wait of a stop for the rest of its request


class StopRequest(msgspec.Struct, frozen=True):
    """Body of POST /api/stop. Repeats of one press carry its id, which is 32 random hex digits; "": a new one."""

    reason: Annotated[str, msgspec.Meta(max_length=MAX_REASON)] = ""
    press: Annotated[str, msgspec.Meta(pattern="^([0-9a-f]{32})?$")] = ""


class _AnyBody(msgspec.Struct, frozen=True):
    reason: object = ""
    press: object = ""


async def read_stop(request: Request) -> StopRequest:
    """Return the body, with its id as it was given. Errors in it are counted, and refuse nothing.

    A missing body refuses nothing either: the network may have lost it, and the robot must not move on meanwhile.
    """
    try:
        found = await _read_in_time(request)
    except RequestError as error:
        count_refused(request.scope, http_error(error).name)
        return StopRequest()
    return StopRequest(stop_text(found.reason)[:MAX_REASON], stop_text(found.press))


async def _read_in_time(request: Request) -> _AnyBody:
    try:
        async with asyncio.timeout(BODY_SECONDS):
            return await read_json(request, _AnyBody)
    except TimeoutError as error:
        raise BodyTooSlow("the body did not arrive in time") from error
