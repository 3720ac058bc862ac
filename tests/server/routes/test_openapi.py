"""The HTTP interface against its own description: a live console, requests made by schemathesis."""

import asyncio
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from schemathesis.checks import not_a_server_error
from schemathesis.config import SchemathesisConfig
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    ignored_auth,
    response_headers_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from lockstep.server.composition.robot_app import create_app
from lockstep.server.routes.openapi import OPERATIONS, openapi_document
from lockstep.server.settings import Settings
from tests.server.offers import offer, section
from tests.server.rig import running_rig
from tests.support.stack import Stack, running_stack

CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
    ignored_auth,
]
EXAMPLES = 5  # of every operation and role
GENEROUS: dict[str, Any] = {
    **{f"max_{name}_{kind}": 100_000 for name in ("request", "refused", "offer") for kind in ("rate", "burst")},
    **{"max_unconnected": 1000, "max_peers": 1000, "peer_connect_timeout": 0.2},
}


async def test_every_answer_to_made_up_requests_is_one_that_is_documented(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The console is a process of its own: Hypothesis watches over the random numbers of this one."""
    for name, value in GENEROUS.items():
        monkeypatch.setenv(f"LOCKSTEP_{name.upper()}", str(value))
    async with running_stack(tmp_path) as stack:
        await asyncio.to_thread(_ask_everything, stack)


def _ask_everything(stack: Stack) -> None:
    schemathesis.openapi.media_type("application/sdp", _offers().map(str.encode))
    schemathesis.openapi.media_type("application/trickle-ice-sdpfrag", _fragments().map(str.encode))
    schema = schemathesis.openapi.from_dict(openapi_document(), config=SchemathesisConfig())
    schema.config.update(base_url=stack.console)
    statuses: set[int] = set()
    for link in (stack.supervisor, stack.observer):
        headers = {"Authorization": f"Bearer {link.partition('#token=')[2]}"}
        for operation in schema.get_all_operations():
            known: Any = operation.ok()  # type: ignore[union-attr]
            if link == stack.supervisor or "403" in known.definition.raw["responses"]:
                _try(known, headers, statuses)
    metrics = httpx.get(f"{stack.console}/metrics", trust_env=False).text
    assert "lockstep_internal_errors_total{" not in metrics
    assert {200, 201, 400, 403, 404} <= statuses, "the requests were of many kinds"


def _try(operation: Any, headers: dict[str, str], statuses: set[int]) -> None:
    @settings(
        max_examples=EXAMPLES,
        deadline=None,
        database=None,
        derandomize=True,
        phases=[Phase.explicit, Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @_given(operation)  # type: ignore[untyped-decorator]
    def ask(case: Any) -> None:
        response = case.call(headers=headers)
        statuses.add(response.status_code)
        case.validate_response(response, checks=CHECKS, headers=headers)

    ask()


def _given(operation: Any) -> Any:
    return given(case=operation.as_strategy())


def _offers() -> st.SearchStrategy[str]:
    good = offer(section("0"), section("1", "audio"), section("2", "application"))
    return st.sampled_from([good, offer(section("0", "application")), "v=0\r\n"]) | st.text(max_size=40)


def _fragments() -> st.SearchStrategy[str]:
    candidate = "a=candidate:1 1 udp 2130706431 127.0.0.1 5000 typ host\r\n"
    return st.sampled_from([candidate, "a=ice-ufrag:abcd\r\n" + candidate, "rubbish", ""]) | st.text(max_size=40)


def test_the_description_names_every_route_and_no_other() -> None:
    routes = {
        (method.lower(), str(getattr(route, "path", "")))
        for route in _routes(create_app(Settings()))
        for method in getattr(route, "methods", None) or ()
        if method != "HEAD"
        and route.include_in_schema
        and getattr(route, "path", "").startswith(
            ("/api", "/whep", "/whip", "/watch", "/healthz", "/readyz", "/metrics")
        )
    }
    assert routes == {(each.method, each.path) for each in OPERATIONS}


def _routes(router: Any) -> Iterator[Any]:
    """Those of included routers too."""
    for route in router.routes:
        included = getattr(route, "original_router", None)
        yield from [route] if included is None else _routes(included)


async def test_the_console_serves_it_to_anyone() -> None:
    async with running_rig() as rig:
        served = (await rig.http.get("/openapi.json")).json()
        assert served == openapi_document()
        assert served["openapi"].startswith("3.1")


@pytest.mark.parametrize("operation", OPERATIONS, ids=lambda each: f"{each.method} {each.path}")
def test_every_operation_says_what_it_refuses(operation: Any) -> None:
    responses = openapi_document([operation])["paths"][operation.path][operation.method]["responses"]
    assert {"421", "429"} <= responses.keys()
    assert ("401" in responses) is operation.token


def test_every_operation_has_an_id_of_its_own_and_a_group() -> None:
    found = [each for path in openapi_document()["paths"].values() for each in path.values()]
    ids = [each["operationId"] for each in found]
    assert len(set(ids)) == len(ids)
    assert "post_api_stop" in ids
    assert all(each["tags"] for each in found)


async def test_an_error_is_problem_details_with_its_stable_name() -> None:
    async with running_rig() as rig:
        refused = await rig.http.get("/api/session")
        assert refused.headers["content-type"] == "application/problem+json"
        said = refused.json()
        assert (said["type"], said["title"], said["status"]) == ("about:blank", "Unauthorized", 401)
        assert said["error"] == "unauthorized"
        assert said["detail"]
