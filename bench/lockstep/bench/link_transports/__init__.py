"""The robot's own link over TLS and TCP, beside the same messages over QUIC, on an emulated path that loses packets."""
