"""Experiments, and the pages of docs/results that show them.

Each experiment was run once, and its page is made from the stored numbers. Records of the underlying runs are in
experiments/records.
"""
