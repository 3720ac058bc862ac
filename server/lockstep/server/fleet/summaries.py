"""Summarises a robot's session as a tile of the overview. No I/O."""

from lockstep.protocol.console import Report
from lockstep.server.federation.robot_summary import MAX_PEOPLE, Person, Tile
from lockstep.server.fleet.event_rate import EventRateMeter
from lockstep.server.state.dependencies import Dependencies

__all__ = ["FAILED", "UNREADABLE", "absent_tile", "tile_of"]

UNREADABLE = "A fault in the console keeps it from reading this robot's state."
FAILED = "The console's session of this robot has failed; it is started again."
MAX_WORDS, MAX_NAME, MAX_FAULTS = 500, 60, 20  # bounds of a tile


def absent_tile(name: str, trouble: str = FAILED) -> Tile:
    """Return the tile of a robot whose session does not run."""
    return Tile(name=name, label="", url=_url(name), link="down", trouble=trouble)


def tile_of(here: Dependencies, meter: EventRateMeter, now: float) -> Tile:
    """Return the tile of a robot whose session runs. `now` is on the monotonic clock."""
    console, clock, robot = here.console, here.console.clock, here.console.robot
    driver = console.peers.by_id(console.seat.state.holder)
    people = [peer for peer in console.peers if not peer.thumbnail]
    people.sort(key=lambda peer: (peer is not driver, peer.role == "observer"))
    description, feedback = robot.description, clock.feedback
    gap, tolerance = (None, None) if driver is None else _gap(driver.report)
    return Tile(
        name=here.robot,
        label="" if description is None else description.label[:MAX_NAME],
        url=_url(here.robot),
        link="up" if robot.up else "down",
        detail=robot.detail[:MAX_WORDS],
        link_age_ms=None if meter.link_since is None else _ms(now - meter.link_since),
        epoch=clock.epoch,
        event=0 if feedback is None else feedback.event,
        event_rate=round(meter.event_rate, 1) if robot.up else 0.0,
        stopped=clock.stop.stopped,
        stop_by=clock.stop.by[:MAX_WORDS],
        stop_reason=clock.stop.reason[:MAX_WORDS],
        at_rest=not clock.moving,
        driver="" if driver is None else driver.name,
        claims=tuple(claim.name for claim in console.seat.message().claims),
        participants=tuple(
            Person(name=peer.name, role=peer.role, driving=peer is driver) for peer in people[:MAX_PEOPLE]
        ),
        participant_count=len(people),
        watching=sum(peer.thumbnail for peer in console.peers),
        feedback_age_ms=None if feedback is None else _ms(now - clock.heard_at),
        gap=gap,
        tolerance=tolerance,
        recording=here.recorder.state().state == "recording",
        faults=() if feedback is None else tuple(fault[:MAX_WORDS] for fault in feedback.faults[:MAX_FAULTS]),
        has_picture=any(offer.kind == "video" for offer in here.media.offers),
    )


def _gap(report: Report) -> tuple[int | None, int | None]:
    """Return the largest gap that the driver's page reported last, and its tolerance; None: it has no pictures."""
    streams = [stream for stream in report.streams if stream.stamp]
    if not streams:
        return None, None
    worst = max(streams, key=lambda stream: abs(stream.gap))
    return worst.gap, worst.tolerance


def _url(name: str) -> str:
    return f"robots/{name}/"


def _ms(seconds: float) -> float:
    return round(max(0.0, seconds) * 1000, 1)
