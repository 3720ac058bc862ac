"""Pictures that a client publishes by WHIP: received over RTP, timed, and decoded in a separate process."""
