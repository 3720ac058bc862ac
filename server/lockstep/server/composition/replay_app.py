"""The player for one file, without a robot: `lockstep replay FILE`."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException

from lockstep.server.auth.tokens import Access
from lockstep.server.errors import ConsoleError, http_error
from lockstep.server.http.problem import problem_response
from lockstep.server.http.security_headers import SecurityHeaders
from lockstep.server.http.static_files import page_router
from lockstep.server.http.trusted_host import HostNames, TrustedHost
from lockstep.server.recording.library import FileLibrary
from lockstep.server.recording.service import RecordingService
from lockstep.server.routes.recorded import recorded_episodes, recordings
from lockstep.server.util.rate_limits import RateLimits

__all__ = ["create_replay_app"]

REQUESTS = 200.0  # Hz, of one address, after a burst of twice as many


def create_replay_app(path: Path, access: Access, host: str) -> FastAPI:
    """Return an app that answers /api/recordings and the page, both for this file alone."""
    service = RecordingService(FileLibrary(path), access, opens_all=True)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        try:
            yield
        finally:
            await service.close()

    app = FastAPI(title="Lockstep replay", docs_url=None, redoc_url=None, openapi_url=None, lifespan=lifespan)
    app.state.recordings = service
    app.include_router(recordings.router)
    app.include_router(recorded_episodes.router)
    app.include_router(page_router())
    app.add_exception_handler(ConsoleError, _answer_console_error)
    app.add_exception_handler(HTTPException, _answer_http_exception)
    app.add_exception_handler(RequestValidationError, _answer_validation_error)
    app.add_middleware(
        TrustedHost, hosts=HostNames((host,)), requests=RateLimits(REQUESTS, 400), count=lambda scope, name: None
    )
    app.add_middleware(SecurityHeaders, lasting_tls=False)
    return app


async def _answer_console_error(request: Request, error: Exception) -> Response:
    if not isinstance(error, ConsoleError):
        raise error
    entry = http_error(error)
    return _error(entry.status, entry.name, error.detail)


async def _answer_http_exception(request: Request, error: Exception) -> Response:
    if not isinstance(error, HTTPException):
        raise error
    return _error(error.status_code, {404: "not_found"}.get(error.status_code, "http_error"), error.detail)


async def _answer_validation_error(request: Request, error: Exception) -> Response:
    return _error(422, "bad_parameter", "a parameter has a value that is not allowed")


def _error(status: int, name: str, detail: str) -> Response:
    return problem_response(status, name, detail)
