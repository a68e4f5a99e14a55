"""Experiments, one per module: each was run once, and its page in docs/results is made from the stored numbers.

Records of the underlying runs are in experiments/records.
"""
