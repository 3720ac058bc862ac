from lockstep.rtc.sctp import SctpSettings
from lockstep.rtc.sctp.sending.fragmentation import WHOLE, Fragmentation
from lockstep.rtc.sctp.sending.send_queue import Message
from lockstep.rtc.sctp.wire.chunks import BEGIN, END, UNORDERED


def test_a_message_that_fits_is_one_chunk() -> None:
    fragmentation = Fragmentation(SctpSettings(), 7)
    [chunk] = fragmentation.chunks(Message(0, 51, bytes(fragmentation.largest)), whole=True)
    assert (chunk.tsn, chunk.flags) == (7, WHOLE)
    assert fragmentation.next_tsn == 8


def test_fragments_have_consecutive_numbers_and_say_which_is_first_and_last() -> None:
    fragmentation = Fragmentation(SctpSettings(), 7)
    message = Message(0, 51, bytes(2 * fragmentation.largest + 1), ordered=False)
    chunks = fragmentation.chunks(message, whole=True)
    assert [(each.tsn, each.flags, each.fragment, each.size) for each in chunks] == [
        (7, BEGIN | UNORDERED, 0, fragmentation.largest),
        (8, UNORDERED, 1, fragmentation.largest),
        (9, END | UNORDERED, 2, 1),
    ]
    assert message.chunks == chunks


def test_with_interleaving_a_message_may_be_cut_one_chunk_at_a_time() -> None:
    fragmentation = Fragmentation(SctpSettings(), 7)
    fragmentation.peer_is(interleaving=True)
    message = Message(0, 51, bytes(fragmentation.largest + 1))
    [first] = fragmentation.chunks(message, whole=False)
    message.taken = first.size
    [second] = fragmentation.chunks(message, whole=False)
    assert (first.flags, second.flags) == (BEGIN, END)
    assert message.chunks == [first, second]


def test_messages_are_numbered_on_their_stream_until_it_is_reset() -> None:
    fragmentation = Fragmentation(SctpSettings(), 7)

    def number(stream: int) -> int:
        message = Message(stream, 51, b"x")
        fragmentation.chunks(message, whole=True)
        return message.sequence

    assert [number(1), number(1), number(2)] == [0, 1, 0]
    fragmentation.reset((1,))
    assert [number(1), number(2)] == [0, 1]
