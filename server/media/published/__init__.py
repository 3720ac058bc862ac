"""Pictures that somebody publishes by WHIP: taken off RTP, timed, and decoded in a process of their own."""
