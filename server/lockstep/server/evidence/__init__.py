"""Makes audit and recordings evidence: hash chains, and signatures of their heads (docs/recording.md)."""
