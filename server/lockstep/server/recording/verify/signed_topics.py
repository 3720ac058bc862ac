"""The topics of a file and their schemas, of which the head of its hash chain is made. No I/O."""

from mcap.records import Channel, Schema

from lockstep.server.recording.format.signature import TopicText

__all__ = ["SignedTopics"]


class SignedTopics:
    """`take` each schema and channel in the order of the file, and `sign` them before the first message."""

    def __init__(self) -> None:
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._is_signed = False

    def take(self, found: Schema | Channel) -> str:
        """Take one and return its fault, or ""."""
        known: Schema | Channel
        if isinstance(found, Schema):
            name, known = f"the schema {found.name}", self._schemas.setdefault(found.id, found)
        else:
            name, known = f"the topic {found.topic}", self._channels.setdefault(found.id, found)
        if known != found:
            return f"{name} differs from the signed one"
        return f"{name} is not signed" if self._is_signed and known is found else ""

    def name(self, channel: int) -> str:
        """Return the topic of that channel. Raises KeyError: there is none."""
        return self._channels[channel].topic

    def sign(self) -> list[TopicText]:
        """Return what the head is made of; topics that come later are not signed. Raises KeyError: a schema lacks."""
        texts = [self._text(channel) for channel in self._channels.values()]
        self._is_signed = True
        return texts

    def _text(self, channel: Channel) -> TopicText:
        schema = self._schemas[channel.schema_id]
        return TopicText(channel.topic, channel.message_encoding, schema.name, schema.encoding, schema.data)
