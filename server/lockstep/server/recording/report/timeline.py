"""The session at a glance, as SVG text whose colours are the page's: episodes, who drove, what was wrong. No I/O."""

from collections.abc import Sequence

from lockstep.server.recording.episodes.episode_list import ListedEpisode
from lockstep.server.recording.report.page_parts import text
from lockstep.server.recording.report.totals import Totals

__all__ = ["timeline_svg"]

WIDTH, LEFT, ROW = 1000, 110, 30
KINDS = ("refusal", "stop", "fault", "link", "lost", "no pictures")


def timeline_svg(episodes: Sequence[ListedEpisode], totals: Totals, began: int, seconds: float) -> str:
    """Return the drawing. `began`: µs since 1970."""
    length = max(seconds, 0.1) * 1e6

    def x(time: int) -> float:
        return LEFT + (WIDTH - LEFT - 10) * min(1.0, max(0.0, (time - began) / length))

    parts: list[str] = []
    rows = ["episodes", *(kind for kind in KINDS if any(each.kind == kind for each in totals.moments))]
    for number, name in enumerate(rows):
        y = 8 + ROW * number
        parts.append(f"<text x='0' y='{y + 15}' class='label'>{text(name)}</text>")
        parts.append(f"<line x1='{LEFT}' x2='{WIDTH - 10}' y1='{y + 22}' y2='{y + 22}' class='axis'/>")
        if name == "episodes":
            for each in episodes:
                wide = max(2.0, x(each.ended) - x(each.started))
                kind = each.outcome if each.state == "kept" and each.outcome else each.state
                title = f"{each.number} {each.task}: {each.state} {each.outcome}"
                parts.append(
                    f"<rect x='{x(each.started):.1f}' y='{y + 4}' width='{wide:.1f}' height='14' class='{kind}'>"
                    f"<title>{text(title)}</title></rect>"
                )
            continue
        for moment in totals.moments:
            if moment.kind == name:
                parts.append(
                    f"<rect x='{x(moment.time):.1f}' y='{y + 2}' width='2.5' height='18' class='wrong'>"
                    f"<title>{text(moment.text)}</title></rect>"
                )
    bottom = 8 + ROW * len(rows)
    for step in range(5):
        at = began + int(length * step / 4)
        anchor = "start" if step == 0 else "end" if step == 4 else "middle"
        place = f"x='{x(at):.1f}' y='{bottom + 10}' text-anchor='{anchor}'"
        parts.append(f"<text class='tick' {place}>{seconds * step / 4:.0f} s</text>")
    return (
        f"<svg class='timeline' viewBox='0 0 {WIDTH} {bottom + 16}' role='img' "
        f"aria-label='Episodes and what was wrong, over time'>{''.join(parts)}</svg>"
    )
