"""Pictures that a client publishes by WHIP: taken off RTP, timed, and decoded in a process of their own."""
