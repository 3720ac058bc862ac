"""Options that choose episodes, which `lockstep episodes` and `lockstep export` share."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated

import typer

from lockstep.protocol.episodes import EpisodeOutcome
from lockstep.server.recording.episodes.episode_filter import EpisodeFilter

__all__ = ["OUTCOMES", "EpisodeChoice", "OutcomeWord"]


class OutcomeWord(StrEnum):
    SUCCESS = "success"
    FAILURE = "failure"
    NONE = "none"


OUTCOMES: dict[OutcomeWord, EpisodeOutcome] = {
    OutcomeWord.SUCCESS: "success",
    OutcomeWord.FAILURE: "failure",
    OutcomeWord.NONE: "",
}


@dataclass(frozen=True)
class EpisodeChoice:
    """Options of a command (`with_options`). Those with a value may be given several times: one of them is enough."""

    only_task: Annotated[list[str] | None, typer.Option(help="Only episodes with this task.")] = None
    only_outcome: Annotated[list[OutcomeWord] | None, typer.Option(help="Only episodes with this outcome.")] = None
    only_driver: Annotated[list[str] | None, typer.Option(help="Only episodes in which this one drove.")] = None
    only_without_problems: Annotated[
        bool, typer.Option("--only-without-problems", help="Only episodes in which the live checks saw no problem.")
    ] = False

    def filter(self) -> EpisodeFilter:
        return EpisodeFilter(
            tasks=sorted(set(self.only_task or [])),
            outcomes=[OUTCOMES[each] for each in OutcomeWord if each in (self.only_outcome or [])],
            drivers=sorted(set(self.only_driver or [])),
            without_problems=self.only_without_problems,
        )
