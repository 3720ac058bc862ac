"""The audit of all robots, those of other consoles too (docs/console-api.md)."""

from typing import Annotated

import msgspec
from fastapi import APIRouter, Depends, Query, Request, Response

from lockstep.server.auth.tokens import Right, require_role
from lockstep.server.federation.board import SharedRecord
from lockstep.server.fleet.fleet import Fleet, fleet_caller, fleet_of
from lockstep.server.http.json_response import json_answer

__all__ = ["MAX_RECORDS", "FleetAudit", "router"]

router = APIRouter()

MAX_RECORDS = 500  # in one answer


class FleetAudit(msgspec.Struct, frozen=True, kw_only=True):
    """Answer of GET /api/fleet/audit."""

    records: list[SharedRecord]  # oldest first
    complete: bool  # the records include those of the other consoles
    detail: str  # reason why they may not


@router.get("/api/fleet/audit")
async def audit(
    request: Request,
    caller: Annotated[Right, Depends(fleet_caller)],
    limit: Annotated[int, Query(ge=1, le=MAX_RECORDS)] = 100,
) -> Response:
    """The newest `limit` records of the robots that the supervisor's link is good for."""
    require_role(caller, "supervisor")
    here = fleet_of(request)
    shared = await here.board.audit(MAX_RECORDS if caller.identity.robots else limit)
    identity = caller.identity
    found = {_key(each): each for each in (*shared.records, *_own(here, limit)) if identity.may_see(each.robot)}
    records = sorted(found.values(), key=lambda each: each.record.time)
    return json_answer(FleetAudit(records=records[-limit:], complete=shared.complete, detail=shared.detail))


def _key(shared: SharedRecord) -> tuple[str, int, float]:
    """Return the key of a record: this console's own records are on the board too."""
    return shared.robot, shared.record.n, shared.record.time


def _own(fleet: Fleet, limit: int) -> list[SharedRecord]:
    """Return the records of this console's robots, from memory: the board need not have them yet."""
    return [
        SharedRecord(console="", robot=name, record=record)
        for name, session in fleet.sessions.items()
        if session.dependencies is not None
        for record in session.dependencies.audit.tail.after(-1, limit)
    ]
