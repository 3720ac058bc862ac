"""Settings of the sources and the speaker attached to the console itself. docs/media.md describes their syntax."""

from typing import Annotated, Self

from pydantic import Field, SecretStr, field_validator, model_validator
from pydantic_settings import BaseSettings, NoDecode

from lockstep.server.media.published.camera_spec import parse_published
from lockstep.server.media.sources.source_url import BadSource, SourceSpec, parse_sources
from lockstep.server.talkback.speaker_url import BadSpeaker, SpeakerSpec, parse_speaker

__all__ = ["SourceSettings"]

Sources = Annotated[tuple[SecretStr, ...], NoDecode]


class SourceSettings(BaseSettings):
    """Part of `Settings`. An environment variable holds several sources, separated by spaces."""

    cameras: Sources = Field(default=(), repr=False)  # they may hold passwords
    microphones: Sources = Field(default=(), repr=False)
    whip: Annotated[tuple[str, ...], NoDecode] = ()  # cameras that clients may publish; empty: none
    speaker: str | None = None  # at the robot, for the driver's voice; None: no voice is taken

    @field_validator("cameras", "microphones", "whip", mode="before")
    @classmethod
    def _split_words(cls, value: object) -> object:
        return tuple(value.split()) if isinstance(value, str) else value

    @model_validator(mode="after")
    def _check_sources(self) -> Self:
        for word, kind, given in (("camera", "video", self.cameras), ("microphone", "audio", self.microphones)):
            try:
                parse_sources("video" if kind == "video" else "audio", _revealed(given))
            except BadSource as error:
                raise ValueError(f"{word}: {error}") from None
        try:
            parse_published(self.whip)
        except BadSource as error:
            raise ValueError(f"whip: {error}") from None
        names = [spec.name for spec in self.sources]
        if twice := next((name for name in names if names.count(name) > 1), ""):
            raise ValueError(f"camera, microphone, whip: the name {twice} is used twice")
        try:
            _ = self.speaker_spec
        except BadSpeaker as error:
            raise ValueError(f"speaker: {error}") from None
        return self

    @property
    def speaker_spec(self) -> SpeakerSpec | None:
        return parse_speaker(self.speaker) if self.speaker else None

    @property
    def sources(self) -> tuple[SourceSpec, ...]:
        """All attached cameras, including published ones, and microphones."""
        return (
            *parse_sources("video", _revealed(self.cameras)),
            *parse_published(self.whip),
            *parse_sources("audio", _revealed(self.microphones)),
        )


def _revealed(texts: tuple[SecretStr, ...]) -> list[str]:
    return [text.get_secret_value() for text in texts]
