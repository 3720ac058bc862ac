"""The commands `invite`, `invitations`, `revoke` and `audit`, which work beside a running console.

They read and change its state directory, which the console watches.
"""

import json
import sys
import time
from collections.abc import Callable, Iterable
from datetime import datetime
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from lockstep.protocol.console import Role
from lockstep.server.audit.audit_file import last_records, stored_records
from lockstep.server.audit.audit_log import anchors_path
from lockstep.server.audit.records import AuditRecord
from lockstep.server.auth.invitations import Invitation
from lockstep.server.cli.access.audit import verify_audit
from lockstep.server.cli.access.durations import duration_words, parse_duration
from lockstep.server.cli.console_address import read_address
from lockstep.server.cli.options import RobotOption, StateDirOption
from lockstep.server.errors import ConsoleError
from lockstep.server.evidence.anchors import ANCHORS_NAME
from lockstep.server.evidence.signer import KEY_FILE, evidence_signer, is_public_key
from lockstep.server.recording.errors import RecordingError
from lockstep.server.settings import Settings
from lockstep.server.state.console_links import console_link
from lockstep.server.state.persistent_state import ConsoleState, open_state, robot_directory, state_path
from lockstep.server.util.display_names import escaped, printable
from lockstep.server.util.state_dir import StateDir, StateDirUnusable

__all__ = ["MakeSettings", "add_access_commands"]

EXIT_BROKEN = 1  # the audit is not as it was written
EXIT_USAGE = 2
FOLLOW_SECONDS = 0.5  # between two looks at the log

Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]
MakeSettings = Callable[..., Settings]


def add_access_commands(app: typer.Typer, make_settings: MakeSettings) -> None:
    """Add the commands. `make_settings` turns flags into settings, as for the other commands."""

    @app.command()
    def invite(
        role: Annotated[str, typer.Option(help="observer, operator, supervisor or policy.")] = "observer",
        expires: Annotated[str, typer.Option(help="The time for which the link is valid: 30m, 8h, 2d.")] = "8h",
        name: Annotated[str, typer.Option(help="The holder's name as others see it; the holder may change it.")] = "",
        for_robot: Annotated[
            list[str] | None,
            typer.Option(help="A robot of the fleet that the link admits to; repeat for several. Unset: all robots."),
        ] = None,
        url: Annotated[str, typer.Option(help="The console's public address, https://robot.example.org.")] = "",
        state_dir: StateDirOption = None,
        as_json: Json = False,
    ) -> None:
        """Make a link that ends after a while, and print it."""
        settings = make_settings(state_dir=state_dir)
        with_state = _state(settings)
        now = with_state.invitations.clock.now()
        try:
            wanted = msgspec.convert(role, Role)
            seconds = parse_duration(expires)
            robots = tuple(for_robot or ())
            made = with_state.invitations.update(lambda known: known.invite(None, wanted, name, seconds, now, robots))
        except msgspec.ValidationError as error:
            raise _usage("--role is observer, operator, supervisor or policy") from error
        except ValueError as error:
            raise _usage(str(error)) from error
        except ConsoleError as error:
            raise _usage(error.detail) from error
        except StateDirUnusable as error:
            raise _usage(str(error)) from error
        base = (
            url.rstrip("/") or settings.public_url or read_address(with_state.directory).url or _settings_url(settings)
        )
        link = console_link(base, with_state.access.sign(made.identity, made.created))
        if as_json:
            _print_json({**_described(made, now), "link": link})
        else:
            sys.stdout.write(f"{link}\n")
            where = f" for {', '.join(made.robots)}" if made.robots else ""
            _say(f"{made.role} {made.name!r}{where}, valid for {expires}; revoke it with: lockstep revoke {made.id}")

    @app.command()
    def invitations(state_dir: StateDirOption = None, as_json: Json = False) -> None:
        """List the links that were given."""
        store = _state(make_settings(state_dir=state_dir)).invitations
        now, found = store.clock.now(), store.known.visible(None)
        if as_json:
            _print_json([_described(each, now) for each in found])
            return
        for each in found:
            by = "at start" if each.at_start else f"by {each.by or 'the command line'}"
            robots = f"  for {', '.join(each.robots)}" if each.robots else ""
            sys.stdout.write(f"{each.id}  {each.role:10}  {_state_words(each, now):14}  {by}  {each.name}{robots}\n")

    @app.command()
    def revoke(
        invitation_id: Annotated[str, typer.Argument(help="The link's id as `lockstep invitations` shows it.")],
        state_dir: StateDirOption = None,
    ) -> None:
        """End a link, those that were invited with it, and everything that is connected with them."""
        state = _state(make_settings(state_dir=state_dir))
        now = state.invitations.clock.now()
        try:
            ended = state.invitations.update(lambda known: known.revoke(None, invitation_id, now))
        except ConsoleError as error:
            raise _usage(error.detail) from error
        except StateDirUnusable as error:
            _note_ended(state, invitation_id, error)
            return
        for each in ended:
            sys.stdout.write(f"revoked {each.id}  {each.role}  {each.name}\n")
        if not ended:
            _say("the link was revoked before")

    @app.command()
    def audit(
        follow: Annotated[
            bool, typer.Option("--follow", "-f", help="Then print new records as they are written.")
        ] = False,
        after: Annotated[int, typer.Option(help="Print only records after this number.")] = 0,
        file: Annotated[
            Path | None, typer.Option(help="Read this log instead of audit.jsonl in the state directory.")
        ] = None,
        directory: Annotated[
            Path | None,
            typer.Argument(metavar="[DIR]", help="The state directory whose audit log to read.", show_default=False),
        ] = None,
        verify: Annotated[
            bool,
            typer.Option(
                "--verify", help="Check whether the log was cut, changed or reordered; exit code 1 if it was."
            ),
        ] = False,
        anchors: Annotated[
            Path | None,
            typer.Option(help="A file or folder of signed heads, or a recording. Unset: the one in the settings."),
        ] = None,
        signed_by: Annotated[
            str, typer.Option(help="The public key of the signed heads. Unset: the state directory's key.")
        ] = "",
        key: Annotated[bool, typer.Option("--key", help="Print the public key of the signatures and exit.")] = False,
        robot: RobotOption = "",
        state_dir: StateDirOption = None,
        as_json: Json = False,
    ) -> None:
        """Show who drove when, stops, refusals, hand-overs, people and notes, with their event references."""
        settings = make_settings(state_dir=state_dir)
        if key:
            sys.stdout.write(_state(settings).signer.public_key + "\n")
            return
        folder = directory or robot_directory(settings, robot)
        path = file or folder / "audit.jsonl"
        if not follow and not path.exists():
            raise _usage(f"there is no audit log at {path}")
        if verify:
            place = anchors or _anchors(settings, folder, robot)
            _verify(
                path, robot, place, signed_by or _public_key(folder if directory else state_path(settings)), as_json
            )
            return
        last = after
        records: Iterable[AuditRecord] = stored_records(path)
        try:
            while True:
                for record in records:
                    if record.n > last:
                        last = record.n
                        sys.stdout.write(_line(record, as_json) + "\n")
                sys.stdout.flush()
                if not follow:
                    return
                time.sleep(FOLLOW_SECONDS)
                records = last_records(path)
        except KeyboardInterrupt:
            return
        except OSError as error:
            raise _usage(f"{path}: {error.strerror}") from error


def _anchors(settings: Settings, folder: Path, robot: str) -> Path:
    if robot and settings.audit_anchor is None and settings.recording.directory is not None:
        return settings.recording.directory / robot / ANCHORS_NAME  # as the console does
    return anchors_path(settings, folder)


def _verify(path: Path, robot: str, anchors: Path, key: str, as_json: bool) -> None:
    if key and not is_public_key(key):
        raise _usage("a public key has 64 hexadecimal digits")
    try:
        verdict = verify_audit(path, robot, anchors, key)
    except OSError as error:
        raise _usage(f"{error.filename}: {error.strerror}") from error
    except RecordingError as error:
        raise _usage(str(error)) from error
    if as_json:
        sys.stdout.write(verdict.as_json().decode() + "\n")
    else:
        verdict.say(path)
    if not verdict.ok:
        raise typer.Exit(EXIT_BROKEN)


def _public_key(directory: Path) -> str:
    """Return the public key of a state directory; "" if it has none. Makes none."""
    if not (directory / KEY_FILE).exists():
        return ""
    try:
        return evidence_signer(StateDir(directory)).public_key
    except StateDirUnusable as error:
        raise _usage(str(error)) from error


def _state(settings: Settings) -> ConsoleState:
    try:
        return open_state(settings)
    except StateDirUnusable as error:
        raise _usage(str(error)) from error


def _note_ended(state: ConsoleState, link: str, error: StateDirUnusable) -> None:
    """Note a revocation when the list cannot be written: a full disk still has the space set aside for this."""
    state.invitations.unwritten.add(link)
    try:
        state.invitations.unwritten.note()
    except StateDirUnusable:
        raise _usage(str(error)) from error
    _say(f"a running console ends the link now and writes the list when the disk accepts it ({error.reason})")


def _usage(text: str) -> typer.Exit:
    _say(text)
    return typer.Exit(EXIT_USAGE)


def _settings_url(settings: Settings) -> str:
    return f"http://{settings.host}:{settings.port}"


def _described(invitation: Invitation, now: float) -> dict[str, object]:
    return {
        "id": invitation.id,
        "role": invitation.role,
        "name": invitation.name,
        "expires": invitation.expires,
        "revoked": invitation.revoked_at is not None,
        "robots": list(invitation.robots),
        "good": invitation.is_good(now),
    }


def _state_words(invitation: Invitation, now: float) -> str:
    if invitation.revoked_at is not None:
        return "revoked"
    return f"{duration_words(invitation.expires - now)} left" if now < invitation.expires else "expired"


def _line(record: AuditRecord, as_json: bool) -> str:
    if as_json:
        return msgspec.json.encode(record).decode()
    when = _when(record.time)
    who = f"{record.who} ({record.role})" if record.role else record.who
    # The text in the file may be from anybody, and a terminal obeys what it prints.
    words = "  ".join(printable(each) for each in (who, record.what, record.detail) if each)
    times = f"  x{record.count}" if record.count > 1 else ""
    return f"{record.n:6}  {when}  s={record.event:<7} {record.kind:10}  {words}{times}"


def _when(time: float) -> str:
    """Return a time in words. `time`: s since 1970, as a file says, which may be any number."""
    try:
        return datetime.fromtimestamp(time).astimezone().strftime("%Y-%m-%d %H:%M:%S")
    except (ValueError, OverflowError, OSError):
        return f"at {time:g} s"


def _print_json(answer: object) -> None:
    sys.stdout.write(json.dumps(answer) + "\n")


def _say(text: str) -> None:
    typer.echo(f"lockstep: {escaped(text)}", err=True)
