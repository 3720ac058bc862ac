"""The HTTP API of invitations and of the audit (docs/console-api.md)."""

import asyncio
from collections.abc import Callable, Iterable
from itertools import count
from typing import Annotated, TypeVar

import msgspec
from fastapi import APIRouter, Depends, Query, Request, Response

from lockstep.protocol.console import Role
from lockstep.server.audit.records import AuditRecord
from lockstep.server.auth.invitations import Invitation, Invitations, may_invite
from lockstep.server.auth.token_signer import MAX_ROBOTS, RobotName
from lockstep.server.auth.tokens import HasRole, Identity, Right, require_role
from lockstep.server.errors import NotAllowed, Silenced, StateUnavailable
from lockstep.server.http.request_body import read_json
from lockstep.server.state.console_links import console_link
from lockstep.server.state.dependencies import Dependencies, authorized, dependencies
from lockstep.server.util.state_dir import StateDirUnusable

__all__ = ["AuditPage", "InvitationInfo", "InvitationList", "InvitationRequest", "NewInvitation", "router"]

router = APIRouter()
Caller = Annotated[Right, Depends(authorized)]

Result = TypeVar("Result")
DEFAULT_SECONDS = 8 * 3600.0
NOTED = "the link has ended for good; the console writes its list of links when the disk accepts it"
UNWRITTEN = "the link has ended until this console restarts, and for good once the disk accepts the change"
MAX_RECORDS = 500  # of the audit in one answer
MAX_ENDED = 500  # links that have ended, in one answer, besides all that are good


class InvitationRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Body of POST /api/invitations."""

    role: Role = "observer"
    name: Annotated[str, msgspec.Meta(max_length=60)] = ""
    seconds: float = DEFAULT_SECONDS
    # Of a fleet; unset: the robot of this route; empty: all those of the inviter's own link.
    robots: Annotated[list[RobotName], msgspec.Meta(max_length=MAX_ROBOTS)] | None = None


class InvitationInfo(msgspec.Struct, frozen=True, kw_only=True):
    id: str
    role: Role
    name: str
    by: str  # inviter; "" when it was made on the command line or at start
    created: float  # s since 1970
    expires: float
    revoked: bool
    connected: int  # peers
    robots: list[str]  # robots of a fleet that it is good for; empty: all


class InvitationList(msgspec.Struct, frozen=True, kw_only=True):
    """Answer of GET /api/invitations."""

    invitations: list[InvitationInfo]  # the newest first; of those that have ended the newest `MAX_ENDED`
    may_invite: list[Role]


class NewInvitation(InvitationInfo, frozen=True, kw_only=True):
    """Answer of POST /api/invitations: the only time that the link is told."""

    link: str


class AuditPage(msgspec.Struct, frozen=True, kw_only=True):
    """Answer of GET /api/audit."""

    records: list[AuditRecord]
    last: int  # number of the newest record there is; 0 for none
    trouble: str  # why the log cannot be written at present; "" when it can


@router.get("/api/invitations")
async def invitations(request: Request, caller: Caller) -> Response:
    here = dependencies(request)
    _require_inviter(caller)
    found = _shown(here.state.invitations.known.visible(caller.identity), here.state.invitations.clock.now())
    return _json(InvitationList(invitations=_infos(here, found), may_invite=list(may_invite(caller.role))))


@router.post("/api/invitations")
async def invite(request: Request, caller: Caller) -> Response:
    here = dependencies(request)
    wanted = await read_json(request, InvitationRequest)
    _require_inviter(caller)
    if here.context.is_silenced(caller.identity.token_id):
        raise Silenced("a supervisor has silenced the STOP of your link; until that ends you cannot invite")
    robots = _wanted_robots(here, wanted)
    by = caller.actor
    try:
        made = await _update(
            here,
            caller.identity,
            lambda known, by, now: known.invite(by, wanted.role, wanted.name, wanted.seconds, now, robots),
        )
    except StateDirUnusable as error:
        raise StateUnavailable(f"nothing was changed: {error.reason}") from error
    here.context.enforce([made], by)
    base = here.settings.public_url or str(request.base_url).rstrip("/")
    if made.robots == (here.robot,):
        base += str(request.scope.get("root_path", ""))  # to this robot, past the overview
    link = console_link(base, here.access.sign(made.identity, made.created))
    return _json(NewInvitation(link=link, **msgspec.structs.asdict(_infos(here, [made])[0])), 201)


@router.delete("/api/invitations/{invitation_id}")
async def revoke(request: Request, caller: Caller, invitation_id: str) -> Response:
    """It, and all that was invited with it, ends at once; so do the peers that are here with them."""
    here = dependencies(request)
    _require_inviter(caller)
    by = caller.actor
    if here.state.invitations.end_at_once(caller.identity, invitation_id):
        here.context.enforce([], by)
    try:
        revoked = await _update(here, caller.identity, lambda known, by, now: known.revoke(by, invitation_id, now))
    except StateDirUnusable as error:
        here.state.invitations.unwritten.add(invitation_id)
        here.console.audit.record("revocation", by, "not on the disk yet", invitation_id)
        raise StateUnavailable(f"{await _noted(here)}: {error.reason}") from error
    here.context.enforce(revoked, by)
    return _json(InvitationList(invitations=_infos(here, revoked), may_invite=[]))


async def _noted(here: Dependencies) -> str:
    """Note a revocation that the list of links did not take, and return the outcome in words."""
    try:
        await asyncio.to_thread(here.state.invitations.unwritten.note)
    except StateDirUnusable:
        return UNWRITTEN
    return NOTED


@router.get("/api/audit")
async def audit(
    request: Request,
    caller: Caller,
    after: int = 0,
    before: Annotated[int, Query(ge=0)] = 0,
    limit: Annotated[int, Query(ge=1, le=MAX_RECORDS)] = 100,
) -> Response:
    """Records behind number `after`; the newest ones for -1; the last ones in front of `before`."""
    require_role(caller, "supervisor")
    log = dependencies(request).audit
    found = log.tail.before(before, limit) if before else log.tail.after(after, limit)
    return _json(AuditPage(records=found, last=log.next_number - 1, trouble=log.trouble))


async def _update(here: Dependencies, by: Identity, change: Callable[[Invitations, Identity, float], Result]) -> Result:
    """Make a change for `by`. Waits for the disk in a thread, and checks the link of `by` when its turn has come.

    Raises:
        StateDirUnusable: the disk does not take it.
    """
    store = here.state.invitations

    def work(known: Invitations) -> Result:
        store.check(by, known)
        return change(known, by, store.clock.now())

    return await asyncio.to_thread(store.update, work)


def _wanted_robots(here: Dependencies, wanted: InvitationRequest) -> tuple[str, ...]:
    if wanted.robots is not None:
        return tuple(wanted.robots)
    return (here.robot,) if here.robot else ()


def _require_inviter(caller: HasRole) -> None:
    if not may_invite(caller.role):
        raise NotAllowed("observers may not invite anyone")


def _shown(found: Iterable[Invitation], now: float) -> list[Invitation]:
    ended = count()
    return [each for each in found if each.is_good(now) or next(ended) < MAX_ENDED]


def _infos(here: Dependencies, found: Iterable[Invitation]) -> list[InvitationInfo]:
    connected = here.context.connected()
    return [
        InvitationInfo(
            id=each.id,
            role=each.role,
            name=each.name,
            by=each.by,
            created=each.created,
            expires=each.expires,
            revoked=here.state.invitations.is_revoked(each.id),
            connected=connected[each.id],
            robots=list(each.robots),
        )
        for each in found
    ]


def _json(answer: msgspec.Struct, status: int = 200) -> Response:
    body = msgspec.json.encode(answer)
    return Response(body, status, media_type="application/json", headers={"Cache-Control": "no-store"})
