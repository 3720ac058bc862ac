"""Answers errors over HTTP: by name, counted, and never cached."""

from http import HTTPStatus

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from prometheus_client import Counter
from starlette.exceptions import HTTPException
from starlette.types import Scope

from lockstep.server.audit.records import Actor
from lockstep.server.errors import ConsoleError, TooManyRequests, http_error
from lockstep.server.http.problem import problem_response
from lockstep.server.state.console_context import ConsoleContext
from lockstep.server.state.dependencies import Dependencies

__all__ = ["answer_errors", "count_refused"]


def answer_errors(app: FastAPI) -> None:
    """Add handlers for all errors that routes of `app` raise on purpose. It needs `app.state.context`."""
    app.add_exception_handler(ConsoleError, _answer_console_error)
    app.add_exception_handler(HTTPException, _answer_http_exception)
    app.add_exception_handler(RequestValidationError, _answer_validation_error)


def count_refused(scope: Scope, name: str) -> None:
    """Count bad input that the middleware found, or that was in the body of a STOP."""
    _bad_input(scope["app"].state).labels("http", name).inc()


def _bad_input(state: object) -> Counter:
    """Return the counter of the routes' robot; of the console context without a session, or without a robot."""
    here = getattr(state, "dependencies", None)
    counted: Counter = here.metrics.bad_input if isinstance(here, Dependencies) else _context(state).metrics.bad_input
    return counted


def _context(state: object) -> ConsoleContext:
    found = getattr(state, "context", None)
    if not isinstance(found, ConsoleContext):
        raise TypeError("the app is not running")
    return found


async def _answer_console_error(request: Request, error: Exception) -> Response:
    if not isinstance(error, ConsoleError):
        raise error
    entry = http_error(error)
    if entry.status == HTTPStatus.FORBIDDEN:
        _audit_refused(request, entry.name)
    if entry.status == HTTPStatus.UNAUTHORIZED and not _may_fail(request):
        error = TooManyRequests("too many requests without a valid token from this address")
        entry = http_error(error)
    return _error_response(request, entry.status, entry.name, error.detail, entry.headers)


def _may_fail(request: Request) -> bool:
    return _context(request.app.state).request_limits.may_fail(request.scope)


def _audit_refused(request: Request, name: str) -> None:
    """Audit a refusal, merged by the route, of which there are few, and never by the path, of which there are many."""
    actor, here = getattr(request.state, "actor", None), getattr(request.app.state, "dependencies", None)
    if isinstance(actor, Actor) and isinstance(here, Dependencies):
        route = getattr(request.scope.get("route"), "path", "")
        here.console.audit.refused(actor, f"{name}: {request.method} {route}")


async def _answer_http_exception(request: Request, error: Exception) -> Response:
    """Answer routes that do not exist, and methods that are not allowed."""
    if not isinstance(error, HTTPException):
        raise error
    name = {404: "not_found", 405: "method_not_allowed"}.get(error.status_code, "http_error")
    return _error_response(request, error.status_code, name, error.detail, dict(error.headers or {}))


async def _answer_validation_error(request: Request, error: Exception) -> Response:
    return _error_response(request, 422, "bad_parameter", "a parameter has a value that is not allowed", {})


def _error_response(request: Request, status: int, name: str, detail: str, headers: dict[str, str]) -> Response:
    _bad_input(request.app.state).labels("http", name).inc()
    return problem_response(status, name, detail, headers)
