"""Serves the page that Vite built, and says how to build it when it is not there."""

import asyncio
import gzip
import mimetypes
import os
import re
from pathlib import Path

from fastapi import APIRouter, Request
from fastapi.responses import FileResponse, HTMLResponse, Response

from server.errors import NotFound

__all__ = ["WEB_DIST", "page_router"]

WEB_DIST = Path(__file__).parent / "web_dist"

PACKED = (".css", ".js", ".md", ".svg", ".txt")  # what is worth compressing; fonts are already
SMALLEST = 1000  # bytes; less is one packet anyway

NOT_BUILT = """<!doctype html><html lang="en"><meta charset="utf-8"><title>Lockstep</title>
<body style="font: 18px/1.5 system-ui; background: #10141a; color: #d7dde5; max-width: 40em; margin: 4em auto">
<h1>The page is not built yet</h1>
<p>The console runs, but the browser page is missing. Build it with</p>
<pre>make setup</pre><p>or by hand with</p><pre>cd web &amp;&amp; npm ci &amp;&amp; npm run build</pre>
<p>and load this page again. The headless client and any WHEP player work without it.</p>
"""


class _PackedFiles:
    """Files compressed once, when they are first asked for, and kept: as many as were built."""

    def __init__(self) -> None:
        self._packed: dict[Path, tuple[int, bytes]] = {}

    async def response(self, found: Path, changed: int, headers: dict[str, str]) -> Response:
        """`changed`: when `found` was, to know whether what is kept is still that file."""
        known = self._packed.get(found)
        if known is None or known[0] != changed:
            known = changed, await asyncio.to_thread(lambda: gzip.compress(found.read_bytes(), mtime=0))
            self._packed[found] = known
        kind = mimetypes.guess_type(found.name)[0] or "application/octet-stream"
        return Response(known[1], media_type=kind, headers={**headers, "Content-Encoding": "gzip"})


def _takes_gzip(request: Request) -> bool:
    """RFC 9110 12.5.3; a quality of 0 is a no."""
    for each in request.headers.get("accept-encoding", "").split(","):
        name, _, parameter = each.strip().partition(";")
        if name.strip().lower() in ("gzip", "*"):
            return re.fullmatch(r"\s*q=0(\.0*)?\s*", parameter) is None
    return False


def page_router(directory: Path = WEB_DIST, first: str = "index.html", *, of_robot: bool = True) -> APIRouter:
    """Routes for `/`, `/recordings`, the hashed assets (cached for good) and the few files beside them.

    Pages know their addresses by their own, so all of this may lie below any prefix.

    Args:
        first: the page at `/`
        of_robot: with the pages that only a robot has
    """
    router = APIRouter()
    root = directory.resolve()
    packed = _PackedFiles()

    def page(name: str) -> Response:
        if not (root / name).is_file():
            return HTMLResponse(NOT_BUILT, headers={"Cache-Control": "no-store"})
        return FileResponse(root / name, headers={"Cache-Control": "no-store"})

    @router.get("/")
    async def index() -> Response:
        return page(first)

    if of_robot:

        @router.get("/recordings")
        async def recordings() -> Response:
            return page("recordings.html")

    @router.get("/{path:path}")
    async def asset(request: Request, path: str) -> Response:
        try:
            found = (root / path).resolve()
            is_page = found.is_relative_to(root) and found.is_file()
        except (OSError, ValueError):  # no name of a file: too long, or with a null character
            is_page = False
        if not is_page:
            raise NotFound("no such page")
        hashed = path.startswith("assets/")
        caching = "public, max-age=31536000, immutable" if hashed else "no-cache"
        headers = {"Cache-Control": caching, "Vary": "Accept-Encoding"}
        state = os.stat(found)
        if found.suffix in PACKED and state.st_size >= SMALLEST and _takes_gzip(request):
            return await packed.response(found, state.st_mtime_ns, headers)
        return FileResponse(found, headers=headers)

    return router
