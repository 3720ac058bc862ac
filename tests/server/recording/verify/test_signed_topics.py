"""Which topics and schemas of a file its signatures cover."""

import pytest
from mcap.records import Channel, Schema

from lockstep.server.recording.format.signature import TopicText
from lockstep.server.recording.verify.signed_topics import SignedTopics

SCHEMA = Schema(data=b"{}", encoding="jsonschema", id=1, name="A")
CHANNEL = Channel(id=4, message_encoding="json", metadata={}, schema_id=1, topic="/a")


def test_topics_are_signed_with_their_schemas_and_may_be_said_again_as_they_are() -> None:
    topics = SignedTopics()
    assert [topics.take(SCHEMA), topics.take(CHANNEL)] == ["", ""]
    assert topics.sign() == [TopicText("/a", "json", "A", "jsonschema", b"{}")]
    again = Channel(id=4, message_encoding="json", metadata={}, schema_id=1, topic="/a")
    assert (topics.take(again), topics.name(4)) == ("", "/a")


def test_what_is_said_in_another_way_differs_and_what_comes_later_is_not_signed() -> None:
    topics = SignedTopics()
    topics.take(SCHEMA)
    topics.sign()
    other = Schema(data=b"{ }", encoding="jsonschema", id=1, name="A")
    assert topics.take(other) == "the schema A differs from the signed one"
    assert topics.take(CHANNEL) == "the topic /a is not signed"


def test_a_topic_without_its_schema_cannot_be_signed() -> None:
    topics = SignedTopics()
    topics.take(CHANNEL)
    with pytest.raises(KeyError):
        topics.sign()
