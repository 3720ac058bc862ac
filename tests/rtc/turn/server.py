"""A TURN server for tests, on a virtual clock: it answers by RFC 8656, as far as a client can tell."""

from lockstep.rtc.addresses import Address
from lockstep.rtc.stun import Kind, is_authentic, pack, pack_address, parse_address, read_attributes, transaction_of
from lockstep.rtc.turn.messages import Attribute, Method, long_term_key, pack_channel_data, parse_channel_data

__all__ = ["REALM", "RELAYED", "TurnServer"]

REALM = b"lockstep.test"
RELAYED = ("198.51.100.1", 50000)
MAPPED = ("203.0.113.9", 1234)


class TurnServer:
    """`answer` gives what it says to a message of the client's."""

    def __init__(self, username: str = "user", password: str = "password", lifetime: int = 600) -> None:
        self.key = long_term_key(username, REALM, password)
        self.nonce = b"first"
        self.lifetime = lifetime
        self.refuses: dict[int, int] = {}  # method → error code
        self.channels: dict[int, Address] = {}
        self.methods: list[int] = []
        self.relayed: list[tuple[bytes, Address]] = []  # what the client has sent, and to whom
        self.asked: list[int] = []  # s, that allocations and refreshes have asked for
        self.closed = False

    def answer(self, message: bytes) -> list[bytes]:
        head = transaction_of(message)
        if head is None:
            parsed = parse_channel_data(message)
            assert parsed is not None
            self.relayed.append((parsed[1], self.channels[parsed[0]]))
            return []
        method = message[0] << 8 & 0x3E00 | message[1] & 0xF
        attributes = read_attributes(message)
        self.methods.append(method)
        if attributes.get(Attribute.NONCE) != self.nonce or not is_authentic(message, self.key):
            code = 438 if Attribute.NONCE in attributes and is_authentic(message, self.key) else 401
            return [self.error(method, head[1], code)]
        if method in self.refuses:
            return [self.error(method, head[1], self.refuses[method])]
        return [self.success(method, head[1], attributes)]

    def error(self, method: int, transaction: bytes, code: int) -> bytes:
        values = [(Attribute.ERROR_CODE, bytes((0, 0, code // 100, code % 100)) + b"no")]
        values += [(Attribute.REALM, REALM), (Attribute.NONCE, self.nonce)]
        return pack(Kind.ERROR, method, transaction, values)

    def success(self, method: int, transaction: bytes, attributes: dict[int, bytes]) -> bytes:
        values: list[tuple[int, bytes]] = []
        if method in (Method.ALLOCATE, Method.REFRESH):
            asked = int.from_bytes(attributes[Attribute.LIFETIME])
            self.asked.append(asked)
            self.closed = asked == 0
            given = min(asked, self.lifetime) if method == Method.ALLOCATE else asked  # as coturn does
            values.append((Attribute.LIFETIME, given.to_bytes(4)))
        if method == Method.ALLOCATE:
            values.append((Attribute.XOR_RELAYED_ADDRESS, pack_address(RELAYED, transaction)))
            values.append((Attribute.XOR_MAPPED_ADDRESS, pack_address(MAPPED, transaction)))
        if method == Method.CHANNEL_BIND:
            peer = parse_address(attributes[Attribute.XOR_PEER_ADDRESS], transaction)
            assert peer is not None
            self.channels[int.from_bytes(attributes[Attribute.CHANNEL_NUMBER][:2])] = peer
        return pack(Kind.SUCCESS, method, transaction, values, self.key)

    def from_peer(self, data: bytes, peer: Address) -> bytes:
        """A datagram that came to the relayed address, as the client gets it."""
        for channel, address in self.channels.items():
            if address == peer:
                return pack_channel_data(channel, data, padded=False)
        values = [(Attribute.XOR_PEER_ADDRESS, pack_address(peer, bytes(12))), (Attribute.DATA, data)]
        return pack(Kind.INDICATION, Method.DATA, bytes(12), values)
