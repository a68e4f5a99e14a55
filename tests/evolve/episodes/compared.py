"""Comparison of episodes."""

import dataclasses
from types import SimpleNamespace

import numpy as np


def assert_same(one, other):
    """Assert that two episodes are equal, bit for bit."""
    for part in ("scene", "plan", "pictures"):
        np.testing.assert_equal(*(vars(getattr(each, part) or SimpleNamespace()) for each in (one, other)))
    plain = [vars(dataclasses.replace(each, scene=None, plan=None, pictures=None)) for each in (one, other)]
    np.testing.assert_equal(*plain)
