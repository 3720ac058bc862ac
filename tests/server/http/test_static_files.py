import base64
import hashlib
import os
from pathlib import Path

import httpx
import pytest
from fastapi import FastAPI, Response
from fastapi.responses import HTMLResponse

from lockstep.server.errors import NotFound
from lockstep.server.http.security_headers import FILE_POLICY, PAGE_POLICY, SecurityHeaders
from lockstep.server.http.static_files import page_router, script_policy


async def _get(directory: Path, path: str, encoding: str = "identity") -> httpx.Response:
    app = FastAPI()
    app.include_router(page_router(directory))
    app.add_middleware(SecurityHeaders)
    async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://console") as http:
        return await http.get(path, headers={"Accept-Encoding": encoding})


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


@pytest.mark.parametrize(
    ("encoding", "packed"),
    [
        ("gzip, br", True),
        ("br, GZIP;q=0.5", True),
        ("*", True),
        ("gzip;q=0", False),
        ("gzip; q=0.0", False),
        ("br", False),
    ],
)
async def test_a_large_text_comes_compressed_to_whoever_takes_that(built: Path, encoding: str, packed: bool) -> None:
    text = "let x = 1;\n" * 1000
    (built / "assets" / "big-1a2b.js").write_text(text)
    found = await _get(built, "/assets/big-1a2b.js", encoding)
    assert (found.text, found.headers["vary"]) == (text, "Accept-Encoding")
    assert found.headers.get("content-encoding") == ("gzip" if packed else None)
    assert (int(found.headers["content-length"]) < len(text) / 10) is packed
    assert "immutable" in found.headers["cache-control"]
    assert "javascript" in found.headers["content-type"]


async def test_a_file_that_was_built_again_is_not_the_old_one(built: Path) -> None:
    app = FastAPI()
    app.include_router(page_router(built))
    file = built / "assets" / "big-1a2b.js"
    async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://console") as http:
        for number in range(2):
            file.write_text(f"let x = {number};\n" * 1000)
            os.utime(file, ns=(number, number))
            assert (await http.get("/assets/big-1a2b.js", headers={"Accept-Encoding": "gzip"})).text == file.read_text()


@pytest.mark.parametrize(
    "path",
    ["/nothing", "/assets", "/..%2fsecret", "/%2e%2e/secret", "/assets/..%2f..%2fsecret", "/%00", "/" + "x" * 5000],
)
async def test_nothing_else_is_served(built: Path, path: str) -> None:
    with pytest.raises(NotFound):
        await _get(built, path)


async def test_a_page_that_is_not_built_says_how_to_build_it(tmp_path: Path) -> None:
    page = await _get(tmp_path, "/")
    assert page.status_code == 200
    assert "make setup" in page.text


async def test_what_the_build_has_packed_is_served_to_whoever_takes_it(built: Path) -> None:
    file = built / "assets" / "big-1a2b.js"
    file.write_text("let x = 1;\n" * 1000)
    digest = hashlib.sha256(file.read_bytes()).hexdigest()[:16]
    file.with_name(f"{file.name}.{digest}.br").write_bytes(b"packed by the build")
    app = FastAPI()
    app.include_router(page_router(built))
    async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://console") as http:

        async def coding(accepted: str) -> str | None:
            async with http.stream("GET", "/assets/big-1a2b.js", headers={"Accept-Encoding": accepted}) as found:
                said: str | None = found.headers.get("content-encoding")
                return said

        assert await coding("gzip, deflate, br, zstd") == "br"
        assert await coding("gzip, br;q=0") == "gzip"
        assert await coding("identity") is None
        file.write_text("let x = 2;\n" * 1000)  # built again, and not packed
        os.utime(file, ns=(2**62, 2**62))
        assert await coding("gzip, br") == "gzip"
        assert await coding("br") is None


async def test_a_page_may_run_the_script_that_stands_in_it_and_no_other(built: Path) -> None:
    script = "let x = '</p>';\nlet y = 2;"
    (built / "index.html").write_text(f"<p>console<script>{script}</script>" + " " * 2000)
    hashed = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    for encoding in ("identity", "gzip"):
        page = await _get(built, "/", encoding)
        allowed = f"script-src 'self' 'sha256-{hashed}';"
        assert page.headers["content-security-policy"] == PAGE_POLICY.replace("script-src 'self';", allowed)
    assert (await _get(built, "/recordings")).headers["content-security-policy"] == PAGE_POLICY


@pytest.mark.parametrize("policy", ["script-src *", "script-src 'self' 'unsafe-inline'", "default-src *", "x"])
async def test_an_answer_opens_nothing_else_of_the_policy(policy: str) -> None:
    app = FastAPI()
    own = {"Content-Security-Policy": policy}
    app.add_api_route("/", lambda: HTMLResponse("", headers=own), response_model=None)
    app.add_api_route("/file", lambda: Response("", headers=own, media_type="image/svg+xml"), response_model=None)
    app.add_middleware(SecurityHeaders)
    async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://console") as http:
        page, file = await http.get("/"), await http.get("/file")
    assert page.headers["content-security-policy"] == PAGE_POLICY
    assert "microphone=(self)" in page.headers["permissions-policy"]
    assert file.headers["content-security-policy"] == FILE_POLICY, "what is no document loads nothing"
    assert "permissions-policy" not in file.headers


def test_a_page_without_scripts_asks_for_no_policy_of_its_own() -> None:
    assert script_policy(b"<p>console") == ""
    assert script_policy(b'<script type="module" src="./assets/a.js"></script>') == ""
