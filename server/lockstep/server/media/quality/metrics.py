"""Quality metrics at /metrics, by tier: peers are too many to be labels. Each tier shows its worst peer."""

from collections.abc import Callable, Sequence

from prometheus_client import CollectorRegistry, Counter, Gauge

from lockstep.server.media.quality.encoding_target import EncodingTarget, PictureTier
from lockstep.server.media.quality.peer_quality import PeerQuality

__all__ = ["QualityMetrics"]


class QualityMetrics:
    """The quality metrics of one media hub; refreshed once a second."""

    def __init__(self, registry: CollectorRegistry) -> None:
        def gauge(name: str, text: str, *labels: str) -> Gauge:
            return Gauge(f"lockstep_media_{name}", text, labels, registry=registry)

        self._members = gauge("tier_peers", "Peers that a tier is made for", "tier")
        self._bitrate = gauge("tier_bitrate_bps", "What the encoder aims at", "stream", "tier")
        self._rate = gauge("tier_frames_per_second", "What the encoder is given", "stream", "tier")
        self._width = gauge("tier_width_pixels", "Width of the pictures", "stream", "tier")
        self._height = gauge("tier_height_pixels", "Height of the pictures", "stream", "tier")
        self._path = gauge("path_rate_bps", "What the controller gives a path, least of the tier", "tier")
        self._estimate = gauge("path_remb_bps", "The peers' own estimate (REMB), least of the tier", "tier")
        self._loss = gauge("path_loss_ratio", "Packets lost, highest of the tier", "tier")
        self._round_trip = gauge("path_round_trip_seconds", "RTCP round trip, longest of the tier", "tier")
        self._queue = gauge("path_queue_seconds", "Round trip beyond that of the empty path, longest", "tier")
        self._repeated = Counter(
            "lockstep_media_packets_retransmitted", "Sent again on request", ["tier"], registry=registry
        )
        self._lowered = Counter(
            "lockstep_media_quality_lowered", "Decreases of an operator's rate", ["reason"], registry=registry
        )
        self._counted: dict[PeerQuality, int] = {}  # retransmissions that were counted

    def lowered(self, reason: str) -> None:
        self._lowered.labels(reason).inc()

    def plan(self, stream: str, tier: PictureTier, plan: EncodingTarget, size: tuple[int, int]) -> None:
        width, height = plan.size(*size)
        self._bitrate.labels(stream, tier).set(plan.bitrate_bps)
        self._rate.labels(stream, tier).set(plan.frame_rate)
        self._width.labels(stream, tier).set(width)
        self._height.labels(stream, tier).set(height)

    def paths(self, tier: PictureTier, peers: Sequence[PeerQuality]) -> None:
        self._members.labels(tier).set(len(peers))
        self._set(self._path, tier, min, [peer.path.rate for peer in peers])
        self._set(self._estimate, tier, min, [peer.estimate_bps for peer in peers])
        self._set(self._loss, tier, max, [peer.loss for peer in peers])
        round_trips = [None if (ms := peer.round_trip_ms) is None else ms / 1000 for peer in peers]
        self._set(self._round_trip, tier, max, round_trips)
        self._set(self._queue, tier, max, [peer.path.round_trips.queue for peer in peers])
        for peer in peers:
            repeated = sum(stats.retransmitted for stats in peer.stats())
            self._repeated.labels(tier).inc(repeated - self._counted.get(peer, 0))
            self._counted[peer] = repeated

    def forget(self, peer: PeerQuality) -> None:
        self._counted.pop(peer, None)

    @staticmethod
    def _set(
        gauge: Gauge, tier: PictureTier, worst: Callable[[list[float]], float], values: Sequence[float | None]
    ) -> None:
        known = [value for value in values if value is not None]
        if known:
            gauge.labels(tier).set(worst(known))
        else:
            gauge.remove_by_labels({"tier": tier})
