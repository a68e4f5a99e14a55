"""What came out: an experiment per module, run once and stored in docs/results, drawn and tabled from the store.

Records of the runs that they rest on are in experiments/records.
"""
