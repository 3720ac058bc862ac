"""What is in a recording: topics, records, index, signatures. No I/O."""
