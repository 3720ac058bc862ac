"""The contents of a recording: topics, records, index, signatures. No I/O."""
