"""What came out: an experiment per module, run once and stored in docs/results, drawn and tabled from the store."""
