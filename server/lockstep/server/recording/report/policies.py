"""The section of a report page about policies: how often they were corrected, succeeded and agreed. No I/O."""

from lockstep.server.recording.report import page_parts as parts
from lockstep.server.recording.report.driver_figures import AGREES, DriverTally

__all__ = ["policies_section"]

WORDS = (
    "An intervention: a person drives in an episode in which a policy has driven before, until somebody else does. "
    "An episode is the policy's alone, or corrected by a person."
)


def policies_section(tally: DriverTally) -> str:
    """Return the section; "" where no policy drove or shadowed."""
    if not tally.has_policy:
        return ""
    found = [f"<p>{parts.text(_rate(tally))}</p>", _drivers(tally)]
    if tally.outcomes:
        found.append(_outcomes(tally))
    if tally.shadows:
        found.append(_shadows(tally))
    return parts.section("policies", "Policies", *found)


def _rate(tally: DriverTally) -> str:
    rate = tally.interventions_per_minute
    if rate is None:
        return "No policy drove in an episode."
    minutes = parts.number(tally.policy_seconds / 60)
    return (
        f"{tally.interventions} interventions in {minutes} minutes of episodes in which a policy drove: "
        f"{parts.number(rate, 2)} a minute."
    )


def _drivers(tally: DriverTally) -> str:
    rows = [
        (name or "nobody", kind, each.events, parts.number(each.seconds), each.interventions, each.intervention_events)
        for (name, kind), each in tally.drivers.items()
    ]
    head = ("Driver", "Kind", "Events", "Driven, s", "Interventions", "Events of these")
    return parts.table(head, rows, WORDS, left=2)


def _outcomes(tally: DriverTally) -> str:
    rows = [
        (who, each.success, each.failure, each.unsaid, parts.share(each.success, each.success + each.failure))
        for who, each in sorted(tally.outcomes.items())
    ]
    return parts.table(("Kept episodes of", "Success", "Failure", "Not said", "Success of those that say"), rows)


def _shadows(tally: DriverTally) -> str:
    rows = [
        (
            name,
            each.judgements.total(),
            ", ".join(f"{what.replace('_', ' ')} {count}" for what, count in each.judgements.most_common()),
            each.compared,
            parts.share(each.agreed, each.compared),
        )
        for name, each in sorted(tally.shadows.items())
    ]
    head = ("Shadow", "Commands", "Judged", "Beside a person", f"Within {AGREES:.0%} of the range")
    words = "Beside a person: events that a person drove, with which the shadow's command is compared axis by axis."
    return parts.table(head, rows, words)
