"""The answer of every error over HTTP: problem details (RFC 9457), extended by the error's stable name."""

from collections.abc import Mapping
from http import HTTPStatus

import msgspec
from starlette.responses import Response

__all__ = ["PROBLEM_JSON", "Problem", "problem_response"]

PROBLEM_JSON = "application/problem+json"


class Problem(msgspec.Struct, frozen=True, kw_only=True):
    """`error` is what a program decides by; `title` and `detail` are for people."""

    error: str  # stable name, "link_down"
    detail: str  # what exactly was wrong
    type: str = "about:blank"  # RFC 9457 4.2.1: the title is that of the status
    title: str
    status: int


def problem_response(status: int, error: str, detail: str, headers: Mapping[str, str] | None = None) -> Response:
    """Return the answer; nothing keeps it."""
    body = msgspec.json.encode(Problem(error=error, detail=detail, title=_title(status), status=status))
    return Response(body, status, {**(headers or {}), "Cache-Control": "no-store"}, media_type=PROBLEM_JSON)


def _title(status: int) -> str:
    try:
        return HTTPStatus(status).phrase
    except ValueError:
        return "Error"
