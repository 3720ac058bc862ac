"""Counters of the media hub, under `lockstep_media_` at /metrics."""

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram

__all__ = ["DropCounter", "MediaMetrics"]

ENCODE_BUCKETS = (0.0005, 0.001, 0.002, 0.004, 0.008, 0.016, 0.033, 0.066, 0.13, 0.5)  # s


class MediaMetrics:
    """The counters of one media hub. Stages of `dropped`, in the order of the path:

    unknown_stream, bad_time, too_often, not_asked, stale_stamp, no_reference, unsupported_codec, bad_payload, thinned,
    encoder_busy, path_busy, encode_failed, worker_failed, peer_busy
    """

    def __init__(self, registry: CollectorRegistry) -> None:
        def counter(name: str, text: str, *labels: str) -> Counter:
            return Counter(f"lockstep_media_{name}", text, labels, registry=registry)

        self.frames_in = counter("frames_in", "Pictures and sound segments from the robot", "stream")
        self.taken = counter("pictures_taken", "Pictures that were encoded for some tier", "stream")
        self.encoded = counter("frames_encoded", "Frames that an encoder put out", "stream", "codec")
        self.tier_frames = counter("tier_frames_encoded", "The same, by what they are made for", "stream", "tier")
        self.dropped = counter("frames_dropped", "Frames that went no further than a stage", "stream", "stage")
        self.packets = counter("packets_sent", "RTP packets sent", "stream", "carrier")
        self.octets = counter("bytes_sent", "Bytes of payload of RTP packets sent", "stream", "carrier")
        self.keyframe_requests = counter("keyframe_requests", "Asked by peers", "stream", "cause")
        self.keyframes = counter("keyframes", "Keyframes encoded", "stream", "codec")
        self.encode_seconds = Histogram(
            "lockstep_media_encode_seconds",
            "Time to encode one frame",
            ["stream", "codec"],
            buckets=ENCODE_BUCKETS,
            registry=registry,
        )
        self.encoders = Gauge(
            "lockstep_media_encoders", "Picture encoders that are open", ["stream", "codec"], registry=registry
        )
        self.uplink_rate = Gauge(
            "lockstep_robot_uplink_bits_per_second",
            "What a robot that encodes is asked for, all media together; 0 for others",
            registry=registry,
        )
        self.second_rate = Gauge(
            "lockstep_robot_second_encoding_bits_per_second",
            "What a robot is asked for second encodings of its cameras, for observers; 0 for none",
            registry=registry,
        )
        self.uplink_wait = Gauge(
            "lockstep_robot_uplink_wait_seconds",
            "Time that its media waited on their way, the least of half a second",
            registry=registry,
        )
        self.peers = Gauge("lockstep_media_peers", "Peers that get a stream", ["stream"], registry=registry)


class DropCounter:
    """Counts the frames of one stream that went no further than a stage."""

    def __init__(self, metrics: MediaMetrics, stream: str) -> None:
        self._metrics = metrics
        self._stream = stream

    def count(self, stage: str, frames: int = 1) -> None:
        self._metrics.dropped.labels(self._stream, stage).inc(frames)
