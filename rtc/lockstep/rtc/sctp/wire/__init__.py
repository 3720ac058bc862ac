"""SCTP packets, chunks and parameters as bytes."""
