from pathlib import Path

import httpx
import pytest
from fastapi import FastAPI

from server.errors import NotFound
from server.page import page_router


async def _get(directory: Path, path: str) -> httpx.Response:
    app = FastAPI()
    app.include_router(page_router(directory))
    async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://console") as http:
        return await http.get(path)


@pytest.fixture
def built(tmp_path: Path) -> Path:
    (tmp_path / "dist" / "assets").mkdir(parents=True)
    (tmp_path / "dist" / "index.html").write_text("<p>console")
    (tmp_path / "dist" / "recordings.html").write_text("<p>recordings")
    (tmp_path / "dist" / "icon.svg").write_text("<svg/>")
    (tmp_path / "dist" / "assets" / "main-1a2b.js").write_text("1")
    (tmp_path / "secret").write_text("secret")
    return tmp_path / "dist"


async def test_the_page_is_never_cached_and_its_hashed_assets_always(built: Path) -> None:
    page = await _get(built, "/")
    assert (page.text, page.headers["cache-control"]) == ("<p>console", "no-store")
    recordings = await _get(built, "/recordings")
    assert (recordings.text, recordings.headers["cache-control"]) == ("<p>recordings", "no-store")
    asset = await _get(built, "/assets/main-1a2b.js")
    assert "immutable" in asset.headers["cache-control"]
    assert "javascript" in asset.headers["content-type"]
    assert (await _get(built, "/icon.svg")).headers["cache-control"] == "no-cache"


@pytest.mark.parametrize("path", ["/nothing", "/assets", "/..%2fsecret", "/%2e%2e/secret", "/assets/..%2f..%2fsecret"])
async def test_nothing_else_is_served(built: Path, path: str) -> None:
    with pytest.raises(NotFound):
        await _get(built, path)


async def test_a_page_that_is_not_built_says_how_to_build_it(tmp_path: Path) -> None:
    page = await _get(tmp_path, "/")
    assert page.status_code == 200
    assert "make setup" in page.text
