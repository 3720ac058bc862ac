"""Serves the page that Vite built, or instructions to build it."""

import asyncio
import base64
import gzip
import hashlib
import mimetypes
import os
import re
from pathlib import Path
from typing import NamedTuple

from fastapi import APIRouter, Request
from fastapi.responses import FileResponse, HTMLResponse, Response

from lockstep.server.errors import NotFound

__all__ = ["WEB_DIST", "page_router", "script_policy", "takes_coding"]

WEB_DIST = Path(__file__).parents[1] / "web_dist"

PACKED = (".css", ".html", ".js", ".md", ".svg", ".txt")  # worth compressing; fonts are compressed already
SMALLEST = 1000  # bytes; less is one packet anyway
CODINGS = ("br", "gzip")
INLINE_SCRIPT = re.compile(rb"<script>(.*?)</script>", re.DOTALL)

NOT_BUILT = """<!doctype html><html lang="en"><meta charset="utf-8"><title>Lockstep</title>
<body style="font: 18px/1.5 system-ui; background: #10141a; color: #d7dde5; max-width: 40em; margin: 4em auto">
<h1>The page is not built yet</h1>
<p>The console runs, but the browser page is missing. Build it with</p>
<pre>make setup</pre><p>or by hand with</p><pre>cd web &amp;&amp; npm ci &amp;&amp; npm run build</pre>
<p>and load this page again. The headless client and any WHEP player work without it.</p>
"""


class _Served(NamedTuple):
    body: bytes
    coding: str  # "" for none
    policy: str  # Content-Security-Policy for its inline scripts; "" without any


class _PackedFiles:
    """Files as they are served: read and compressed at the first request, and kept; as many as were built."""

    def __init__(self) -> None:
        self._served: dict[tuple[Path, frozenset[str]], tuple[int, _Served]] = {}

    async def response(self, found: Path, request: Request, headers: dict[str, str]) -> Response:
        """Return the file in the best coding that the browser accepts, if it is worth compressing."""
        state = os.stat(found)
        worth = found.suffix in PACKED and state.st_size >= SMALLEST
        accepted = request.headers.get("accept-encoding", "")
        codings = frozenset(each for each in CODINGS if worth and takes_coding(accepted, each))
        known = self._served.get((found, codings))
        if known is None or known[0] != state.st_mtime_ns:
            known = state.st_mtime_ns, await asyncio.to_thread(_served, found, codings)
            self._served[found, codings] = known
        body, coding, policy = known[1]
        kind = mimetypes.guess_type(found.name)[0] or "application/octet-stream"
        more = {"Vary": "Accept-Encoding", "Content-Encoding": coding, "Content-Security-Policy": policy}
        return Response(body, media_type=kind, headers=headers | {name: each for name, each in more.items() if each})


def _served(found: Path, codings: frozenset[str]) -> _Served:
    plain = found.read_bytes()
    policy = script_policy(plain) if found.suffix == ".html" else ""
    packed = found.with_name(f"{found.name}.{hashlib.sha256(plain).hexdigest()[:16]}.br")  # if the build made it
    if "br" in codings and packed.is_file():
        return _Served(packed.read_bytes(), "br", policy)
    if "gzip" in codings:
        return _Served(gzip.compress(plain, mtime=0), "gzip", policy)
    return _Served(plain, "", policy)


def script_policy(html: bytes) -> str:
    """Return the directive that allows exactly a page's inline scripts (CSP 3, 2.3.1); "" without any."""
    hashes = [base64.b64encode(hashlib.sha256(each).digest()).decode() for each in INLINE_SCRIPT.findall(html)]
    return " ".join(["script-src 'self'", *(f"'sha256-{each}'" for each in hashes)]) if hashes else ""


def takes_coding(accepted: str, coding: str) -> bool:
    """True if an Accept-Encoding (RFC 9110 12.5.3) accepts `coding`; a quality of 0 refuses it."""
    for each in accepted.split(","):
        name, _, parameter = each.strip().partition(";")
        if name.strip().lower() in (coding, "*"):
            return re.fullmatch(r"\s*q=0(\.0*)?\s*", parameter) is None
    return False


def page_router(directory: Path = WEB_DIST, first: str = "index.html", *, of_robot: bool = True) -> APIRouter:
    """Return routes for the pages, the hashed assets (cached for good) and the few files beside them.

    Pages use relative addresses, so all of this may lie below any prefix.

    Args:
        first: the page at `/`
        of_robot: include the pages that only a robot has
    """
    router = APIRouter()
    root = directory.resolve()
    packed = _PackedFiles()

    async def page(name: str, request: Request) -> Response:
        if not (root / name).is_file():
            return HTMLResponse(NOT_BUILT, headers={"Cache-Control": "no-store"})
        return await packed.response(root / name, request, {"Cache-Control": "no-store"})

    @router.get("/")
    async def index(request: Request) -> Response:
        return await page(first, request)

    if of_robot:

        @router.get("/recordings")
        async def recordings(request: Request) -> Response:
            return await page("recordings.html", request)

        @router.get("/episodes")
        async def episodes(request: Request) -> Response:
            return await page("episodes.html", request)

    @router.get("/{path:path}")
    async def asset(request: Request, path: str) -> Response:
        try:
            found = (root / path).resolve()
            is_page = found.is_relative_to(root) and found.is_file()
        except (OSError, ValueError):  # not a file name: too long, or with a null character
            is_page = False
        if not is_page:
            raise NotFound("no such page")
        hashed = path.startswith("assets/")
        headers = {"Cache-Control": "public, max-age=31536000, immutable" if hashed else "no-cache"}
        if found.suffix in PACKED:
            return await packed.response(found, request, headers)
        return FileResponse(found, headers=headers)

    return router
