"""JSON responses that no cache stores."""

import msgspec
from fastapi import Response

__all__ = ["json_answer"]


def json_answer(answer: object, status: int = 200) -> Response:
    return Response(
        msgspec.json.encode(answer), status, media_type="application/json", headers={"Cache-Control": "no-store"}
    )
