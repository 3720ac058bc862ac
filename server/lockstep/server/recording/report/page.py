"""The report of a recorded session as one HTML page: what was kept, by driver and camera, and what was wrong."""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from lockstep.server.recording.episodes.edit_rules import edited
from lockstep.server.recording.episodes.edits import read_edits
from lockstep.server.recording.episodes.episode_list import ListedEpisode, listed_episodes
from lockstep.server.recording.errors import RecordingError
from lockstep.server.recording.format.payload import own_record_of
from lockstep.server.recording.format.topics import CAMERA, stream_of
from lockstep.server.recording.reading.picture_at import picture_at
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.reading.session_parts import SessionParts, session_parts
from lockstep.server.recording.recording_store import entry_of
from lockstep.server.recording.report import page_parts as parts
from lockstep.server.recording.report.driver_figures import DriverTally
from lockstep.server.recording.report.policies import policies_section
from lockstep.server.recording.report.timeline import timeline_svg
from lockstep.server.recording.report.totals import Moment, Totals
from lockstep.server.recording.verify.promises import Verdict
from lockstep.server.recording.verify.verify_file import verify_file

__all__ = ["session_page"]

MAX_SHOWN = 24  # moments that are shown with pictures
MAX_CAMERAS = 3  # of each
MAX_EPISODES = 500
WIDTH = 320  # pixels


class Figure(NamedTuple):
    """A drawing of the page."""

    name: str
    title: str
    words: str
    body: str  # HTML


class SessionFacts(NamedTuple):
    title: str
    robot: str
    began: int  # µs since 1970
    seconds: float
    totals: Totals
    tally: DriverTally
    episodes: list[ListedEpisode]
    pictures: dict[int, list[str]]  # HTML, by the place of the moment


def session_page(recording: Path, figures: Sequence[Figure] = (), *, alone: bool = False) -> str:
    """Return the page of a recording, with further figures at its end.

    It is that of the whole session if the recording is its first part, and not `alone`.

    Raises:
        RecordingError, OSError: the recording cannot be read.
    """
    files, left_out = SessionParts([recording], []) if alone else session_parts(recording)
    facts = _facts(files)
    verdicts = [verify_file(each) for each in files]
    totals = facts.totals
    at = datetime.fromtimestamp(facts.began / 1e6, UTC)
    events, commands, media = (
        sum(getattr(each, name) for each in verdicts) for name in ("events", "commands", "pictures_and_sounds")
    )
    lead = (
        f"{facts.robot}, {at:%Y-%m-%d %H:%M:%S} UTC, {facts.seconds:.1f} s, {events} events, "
        f"{commands} commands, {media} pictures and sounds."
        + (f" In {len(files)} files." if len(files) > 1 else "")
        + (f" Without the rest: {'; '.join(left_out)}." if left_out else "")
    )
    sections = [
        parts.section(
            "overview", "Overview", _overview(facts), timeline_svg(facts.episodes, totals, facts.began, facts.seconds)
        ),
        _promises(verdicts),
        parts.section("drivers", "Drivers", _drivers(totals)),
        policies_section(facts.tally),
        parts.section("cameras", "Cameras", _cameras(totals)),
        parts.section("episodes", "Episodes", _episodes(facts.episodes)),
        parts.section("wrong", "What was wrong", _wrong(facts)),
        *(
            parts.section(each.name, each.title, f"<p class='quiet'>{parts.text(each.words)}</p>", each.body)
            for each in figures
        ),
    ]
    return parts.page(facts.title, lead, sections)


def _facts(files: Sequence[Path]) -> SessionFacts:
    with RecordingReader(files[0]) as reader:
        info, began, ended = reader.info, reader.index.started, reader.index.ended
        totals, tally = Totals(), DriverTally()
    epoch = ""
    episodes: list[ListedEpisode] = []
    pictures: dict[int, list[str]] = {}
    for path in files:
        shown = len(totals.moments)
        with RecordingReader(path) as reader:
            totals.next_part(reader.description(), goes_on=reader.info.epoch == epoch)
            epoch = reader.info.epoch
            _count(reader, totals, tally)
            ended = reader.index.ended
            try:
                edits = read_edits(path)
            except OSError:
                edits = []
            tally.take_episodes(edited(reader.index.episodes, edits))
            episodes += listed_episodes(entry_of(path, reader.info, reader.index), reader.index, edits).episodes
            mine = range(shown, min(len(totals.moments), MAX_SHOWN))
            pictures |= {at: _pictures(reader, totals.moments[at]) for at in mine}
    totals.end(ended)
    seconds = (ended - began) / 1e6
    return SessionFacts(info.name or files[0].stem, info.robot, began, seconds, totals, tally, episodes, pictures)


def _count(reader: RecordingReader, totals: Totals, tally: DriverTally) -> None:
    for number in range(len(reader.index.chunks)):
        try:
            for record in reader.chunk(number):
                arrived = record.arrived // 1000
                if record.topic.startswith(CAMERA):
                    keyframe, captured = record.keyframe, record.captured // 1000
                    totals.picture(stream_of(record.topic), record.event, arrived, captured, keyframe=keyframe)
                    continue
                own = own_record_of(record.schema, record.data)
                if own is not None:
                    totals.own(own, arrived)
                    tally.take(own)
        except RecordingError:
            continue  # the check of what is promised says so


def _pictures(reader: RecordingReader, moment: Moment) -> list[str]:
    """Return the pictures of a moment, as HTML. One that cannot be decoded is left out."""
    names = (
        [moment.camera]
        if moment.camera
        else [topic.removeprefix(CAMERA) for topic in reader.index.keyframes if topic.startswith(CAMERA)]
    )
    found = []
    for camera in names[:MAX_CAMERAS]:
        try:
            shown = picture_at(reader, camera, moment.event, WIDTH)
        except (RecordingError, OSError):
            continue
        if shown is not None:
            words = f"{camera}, stamped {shown.stamp}"
            found.append(
                f"<figure>{parts.picture(shown.jpeg, words)}<figcaption>{parts.text(words)}</figcaption></figure>"
            )
    return found


def _overview(facts: SessionFacts) -> str:
    totals = facts.totals
    median = totals.intervals.percentile(0.5)
    kept = [each for each in facts.episodes if each.state == "kept"]
    rows = [
        ("Events a second, median", parts.number(1 / median if median else None, 1)),
        ("Refusals", sum(sum(each.refusals.values()) for each in totals.drivers.values())),
        ("Take-overs", sum(each.take_overs for each in totals.drivers.values())),
        ("Take-overs a minute", parts.number(_rate(facts), 2)),
        ("Stops that were pressed", totals.stops),
        ("Records that the recorder left out", totals.lost),
        ("Episodes kept", f"{len(kept)} of {len(facts.episodes)}"),
        ("Of these, successes", f"{sum(each.outcome == 'success' for each in kept)}"),
    ]
    tiles = "".join(f"<div><dt>{parts.text(name)}</dt><dd>{parts.text(value)}</dd></div>" for name, value in rows)
    return f"<dl class='tiles'>{tiles}</dl>"


def _rate(facts: SessionFacts) -> float | None:
    driven = sum(each.seconds for each in facts.totals.drivers.values())
    count = sum(each.take_overs for each in facts.totals.drivers.values())
    return count * 60 / driven if driven else None


def _promises(verdicts: Sequence[Verdict]) -> str:
    rows = ""
    for name in verdicts[0].checks:
        checks = [each.checks[name] for each in verdicts]
        looked, count, is_kept = (
            sum(each.looked for each in checks),
            sum(each.count for each in checks),
            all(each.ok for each in checks),
        )
        rows += (
            f"<tr><th scope='row' class='left'>{name.replace('_', ' ')}</th><td>{looked or ''}</td>"
            f"<td><span class='{'good' if is_kept else 'bad'}'>"
            f"{'kept' if is_kept else f'{count} times not'}</span></td></tr>"
        )
    names = ("<th scope='col' class='left'>promise</th>", "<th scope='col'>looked at</th>", "<th scope='col'></th>")
    head = f"<thead><tr>{''.join(names)}</tr></thead>"
    return parts.section("promises", "Promises", f"<table class='plain'>{head}<tbody>{rows}</tbody></table>")


def _drivers(totals: Totals) -> str:
    rows = [
        (
            each.name or "nobody",
            each.role,
            parts.number(each.seconds),
            each.events,
            each.commands,
            ", ".join(f"{reason} {count}" for reason, count in sorted(each.refusals.items())) or "0",
            each.take_overs,
            parts.number(each.answered.percentile(0.5)),
            parts.number(each.answered.percentile(0.95)),
            parts.number(each.pictures.percentile(0.5), 0),
            parts.number(each.pictures.percentile(0.95), 0),
        )
        for each in totals.drivers.values()
        if each.name or each.events > 1 or each.refusals
    ]
    head = ("Driver", "Role", "With the seat, s", "Events", "Commands", "Refusals", "Take-overs")
    delays = ("Command → feedback, ms", "95 %", "Command → picture, ms", "95 %")
    words = (
        "A take-over: the seat went from one driver directly to another, or a supervisor took it. Command to "
        "feedback is measured at the console, command to picture by the driver's own page."
    )
    return parts.table((*head, *delays), rows, words, left=2)


def _cameras(totals: Totals) -> str:
    def hertz(interval: float | None) -> float | None:
        return 1 / interval if interval else None

    rows = [
        (
            each.name,
            each.count,
            parts.number(hertz(each.intervals.percentile(0.5))),
            parts.number(each.promised or None),
            each.silences,
            parts.number(each.longest),
            parts.number(each.behind.percentile(0.5), 0),
            parts.number(each.behind.percentile(0.99), 0),
            each.shown_gap,
        )
        for each in totals.cameras.values()
    ]
    head = ("Camera", "Pictures", "Rate, Hz", "Promised, Hz", "Silences", "Longest, s")
    gaps = ("Behind the feedback, events", "99 %", "Largest gap that was shown")
    words = (
        "A silence: more than a second without a picture, or three of its intervals. Behind: by how many events the "
        "stamp of a picture was older than the newest feedback when it came."
    )
    return parts.table((*head, *gaps), rows, words)


def _episodes(episodes: list[ListedEpisode]) -> str:
    rows = [
        (
            f"{each.number} {each.task}",
            " ".join(filter(None, (each.state, each.outcome, each.why))),
            ", ".join(each.drivers),
            parts.number(max(0, each.ended - each.started) / 1e6),
            each.events,
            "; ".join([*each.problems, *([f"pause {each.pause / 1e6:.1f} s"] if each.pause else [])]),
        )
        for each in episodes[:MAX_EPISODES]
    ]
    words = "With all changes that were made to them." if episodes else ""
    if len(episodes) > MAX_EPISODES:
        words += f" The first {MAX_EPISODES} of {len(episodes)}."
    return parts.table(("Take and task", "State", "Drivers", "Length, s", "Events", "Problems"), rows, words, left=3)


def _wrong(facts: SessionFacts) -> str:
    moments = facts.totals.moments
    if not moments:
        return "<p>Nothing that the recording tells of.</p>"
    shown = []
    for at, each in enumerate(moments[:MAX_SHOWN]):
        when = f"{(each.time - facts.began) / 1e6:.1f} s, event {each.event}"
        stills = "".join(facts.pictures.get(at, []))
        shown.append(
            f"<li><h3>{parts.text(each.kind)}: {parts.text(each.text)}</h3><p class='quiet'>{when}</p>"
            f"<div class='stills'>{stills}</div></li>"
        )
    rest = [
        (each.kind, each.text, f"{(each.time - facts.began) / 1e6:.1f} s", each.event) for each in moments[MAX_SHOWN:]
    ]
    more = parts.table(("Kind", "What", "When", "Event"), rest, left=2) if rest else ""
    return f"<ol class='moments'>{''.join(shown)}</ol>{more}"
