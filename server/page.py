"""Serves the page that Vite built, and says how to build it when it is not there."""

from pathlib import Path

from fastapi import APIRouter, Request
from fastapi.responses import FileResponse, HTMLResponse, Response

from server.errors import NotFound

__all__ = ["WEB_DIST", "page_router"]

WEB_DIST = Path(__file__).parent / "web_dist"

NOT_BUILT = """<!doctype html><html lang="en"><meta charset="utf-8"><title>Lockstep</title>
<body style="font: 18px/1.5 system-ui; background: #10141a; color: #d7dde5; max-width: 40em; margin: 4em auto">
<h1>The page is not built yet</h1>
<p>The console runs, but the browser page is missing. Build it with</p>
<pre>make setup</pre><p>or by hand with</p><pre>cd web &amp;&amp; npm ci &amp;&amp; npm run build</pre>
<p>and load this page again. The headless client and any WHEP player work without it.</p>
"""


def page_router(directory: Path = WEB_DIST, first: str = "index.html", *, of_robot: bool = True) -> APIRouter:
    """Routes for `/`, `/recordings`, the hashed assets (cached for good) and the few files beside them.

    Pages know their addresses by their own, so all of this may lie below any prefix.

    Args:
        first: the page at `/`
        of_robot: with the pages that only a robot has
    """
    router = APIRouter()
    root = directory.resolve()

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
        found = (root / path).resolve()
        if not found.is_relative_to(root) or not found.is_file():
            raise NotFound("no such page")
        hashed = path.startswith("assets/")
        caching = "public, max-age=31536000, immutable" if hashed else "no-cache"
        return FileResponse(found, headers={"Cache-Control": caching})

    return router
