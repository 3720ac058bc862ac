"""Invitations: links given to people, and the rules for giving and revoking them. No I/O, no clock.

| role | may invite | sees and revokes |
|---|---|---|
| observer, policy | – | – |
| operator | observers, policies, operators | what it invited |
| supervisor | anyone | everything |

An invitation ends no later than the link it was made with, is revoked with it, and is good only for robots that this
link is good for.
"""

import secrets
from typing import Annotated

import msgspec

from lockstep.protocol.console import Role
from lockstep.server.auth.token_signer import MAX_ROBOTS
from lockstep.server.auth.tokens import Identity
from lockstep.server.errors import BadParameter, NotAllowed, NotFound, TooManyInvitations
from lockstep.server.util.display_names import clean_name
from lockstep.server.util.robot_names import BadFleet, check_robot_name

__all__ = ["MAX_SECONDS", "Invitation", "Invitations", "may_invite"]

MAX_LIVE = 500
MAX_KEPT = 5000  # with those that ended lately
FOR_SUPERVISORS = 0.1  # share of both: an operator who makes links without end shuts nobody else out
FAMILY = 0.25  # largest share of both for links invited with an operator's link, or with these
MIN_SECONDS = 60.0
MAX_SECONDS = 366 * 24 * 3600.0
SHOWN_AFTER_END = 24 * 3600.0  # s that an ended one stays in the list

_MAY_INVITE: dict[Role, tuple[Role, ...]] = {
    "observer": (),
    "policy": (),
    "operator": ("observer", "policy", "operator"),
    "supervisor": ("observer", "policy", "operator", "supervisor"),
}


class Invitation(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """The stored part of a link: never the token, which the key makes again from this."""

    id: Annotated[str, msgspec.Meta(min_length=1, max_length=64)]  # the token's jti
    role: Role
    name: str
    created: float  # s since 1970, as all times here
    expires: float
    by: str = ""  # name of the inviter; "" from the command line or made at start
    by_link: str = ""  # id of the link that it was made with
    at_start: bool = False  # printed by every start of the console
    revoked_at: float | None = None
    robots: tuple[str, ...] = ()  # robots of a fleet that it is good for; empty: all

    @property
    def identity(self) -> Identity:
        return Identity(self.role, self.name, self.id, self.expires, self.robots, self.created)

    def concerns(self, robot: str) -> bool:
        """True if it is good for that robot; "" is the robot of a console that has only one."""
        return self.identity.may_see(robot)

    def is_good(self, now: float) -> bool:
        return self.revoked_at is None and now < self.expires


def may_invite(role: Role) -> tuple[Role, ...]:
    return _MAY_INVITE[role]


class Invitations:
    """All invitations. `now` is seconds since 1970; `by` is None on the command line, which may do everything."""

    def __init__(self, known: list[Invitation]) -> None:
        self._known = {invitation.id: invitation for invitation in known}

    @property
    def all(self) -> list[Invitation]:
        return list(self._known.values())

    def invited_with(self, invitation_id: str) -> str:
        """Return the link that this one was made with; "" if it was made without one, or is unknown."""
        found = self._known.get(invitation_id)
        return "" if found is None else found.by_link

    def revoked(self) -> frozenset[str]:
        return frozenset(each.id for each in self._known.values() if each.revoked_at is not None)

    def invite(
        self, by: Identity | None, role: Role, name: str, seconds: float, now: float, robots: tuple[str, ...] = ()
    ) -> Invitation:
        """Make an invitation for those `robots` of a fleet, or for as many as `by` may see.

        Raises:
            NotAllowed: the role of `by` may not invite `role`, or it may not see a robot itself.
            BadParameter: the time is not within bounds, or a robot's name is not valid.
            TooManyInvitations: revoke some first.
        """
        if by is not None and role not in may_invite(by.role):
            raise NotAllowed(f"{'an' if by.role != 'supervisor' else 'a'} {by.role} may not invite a person as {role}")
        _check_robots(robots)
        if by is not None and by.robots:
            robots = robots or by.robots
            if not set(robots) <= set(by.robots):
                raise NotAllowed("your own link does not admit to all of these robots")
        if not MIN_SECONDS <= seconds <= MAX_SECONDS:
            raise BadParameter(f"a link is valid for {MIN_SECONDS:g} to {MAX_SECONDS:g} seconds")
        self._check_room(by, now)
        expires = now + seconds if by is None else min(now + seconds, by.expires)
        return self._add(
            Invitation(
                id=secrets.token_hex(8),
                role=role,
                name=clean_name(name, role),
                created=now,
                expires=expires,
                by="" if by is None else by.name,
                by_link="" if by is None else by.token_id,
                robots=tuple(sorted(set(robots))),
            )
        )

    def _check_room(self, by: Identity | None, now: float) -> None:
        share = 1.0 if by is None or by.role == "supervisor" else 1.0 - FOR_SUPERVISORS
        live, kept = int(MAX_LIVE * share), int(MAX_KEPT * share)
        if sum(each.is_good(now) for each in self._known.values()) >= live:
            raise TooManyInvitations(f"{live} links are valid already; revoke some first")
        if by is not None and len(self._known) >= kept:
            raise TooManyInvitations(f"the console remembers {kept} links; make this one on its command line")
        if by is not None and by.role != "supervisor":
            self._check_family(by, now)

    def _check_family(self, by: Identity, now: float) -> None:
        """Raise TooManyInvitations if the link of `by`, with all that it invited, has used up its share.

        The link that the console prints may be everybody's, so no share bounds it.
        """
        own = self._known.get(by.token_id)
        if own is not None and own.at_start:
            return
        founders = self._founders()
        founder = founders.get(by.token_id, by.token_id)
        family = [each for key, each in self._known.items() if key != founder and founders[key] == founder]
        live, kept = int(MAX_LIVE * FAMILY), int(MAX_KEPT * FAMILY)
        if sum(each.is_good(now) for each in family) >= live:
            raise TooManyInvitations(f"your link and its guests have made {live} links; revoke some first")
        if len(family) >= kept:
            raise TooManyInvitations(f"the console remembers {kept} links of yours; ask a supervisor for one")

    def _founders(self) -> dict[str, str]:
        """Map each link to the first in its line of inviters, which nobody or the printed link invited."""
        found: dict[str, str] = {}
        for invitation in self._known.values():
            line: dict[str, None] = {}
            at = invitation
            while at.id not in found:
                line[at.id] = None
                inviter = self._known.get(at.by_link)
                if inviter is None or inviter.at_start or inviter.id in line:
                    found[at.id] = at.by_link if inviter is None and at.by_link else at.id
                    break
                at = inviter
            found.update(dict.fromkeys(line, found[at.id]))
        return found

    def for_start(self, role: Role, seconds: float, now: float) -> Invitation:
        """Return the link that the console prints: the same one at every start until half of its time is over."""
        for each in self._known.values():
            if each.at_start and each.role == role and each.is_good(now) and each.expires - now >= seconds / 2:
                return each
        fresh = Invitation(
            id=secrets.token_hex(8), role=role, name=role, created=now, expires=now + seconds, at_start=True
        )
        return self._add(fresh)

    def revoke(self, by: Identity | None, invitation_id: str, now: float) -> list[Invitation]:
        """Revoke an invitation and all that was invited with it; return those that were not revoked before.

        Raises:
            NotFound: there is no such invitation that `by` may revoke.
        """
        if all(each.id != invitation_id for each in self.visible(by)):
            raise NotFound("no such invitation")
        ended = {invitation_id}
        while more := {each.id for each in self._known.values() if each.by_link in ended} - ended:
            ended |= more
        revoked = []
        for each in [self._known[found] for found in ended]:
            if each.revoked_at is None:
                self._known[each.id] = msgspec.structs.replace(each, revoked_at=now)
                revoked.append(self._known[each.id])
        return revoked

    def visible(self, by: Identity | None) -> list[Invitation]:
        """Return the invitations that `by` may see, newest first."""
        found = [each for each in self._known.values() if by is None or _sees(by, each)]
        return sorted(found, key=lambda each: each.created, reverse=True)

    def prune(self, now: float) -> None:
        """Forget those that expired long ago. A revoked one is kept until it would have expired."""
        self._known = {key: each for key, each in self._known.items() if now < each.expires + SHOWN_AFTER_END}

    def _add(self, invitation: Invitation) -> Invitation:
        self._known[invitation.id] = invitation
        return invitation


def _check_robots(robots: tuple[str, ...]) -> None:
    if len(robots) > MAX_ROBOTS:
        raise BadParameter(f"a link names at most {MAX_ROBOTS} robots")
    try:
        for each in robots:
            check_robot_name(each)
    except BadFleet as error:
        raise BadParameter(str(error)) from error


def _sees(by: Identity, invitation: Invitation) -> bool:
    if invitation.by_link == by.token_id:
        return True
    within = not by.robots or (bool(invitation.robots) and set(invitation.robots) <= set(by.robots))
    return by.role == "supervisor" and within
