"""The reward is the formula at the top of sim/tasks/reward.py."""

import numpy as np
import pytest

from sim.tasks import reward
from sim.tasks.reward import MODES, TERMS, check_mode, reward_terms


def table():
    """Return the weights of each mode from the module's docstring."""
    rows = [line.split() for line in reward.__doc__.splitlines()]
    return {row[0]: [float(number) for number in row[1:5]] for row in rows if row and row[0] in MODES and len(row) > 5}


def test_the_formulas_weights_are_those_in_use():
    assert table() == {mode: [getattr(weights, term) for term in TERMS] for mode, weights in MODES.items()}


@pytest.mark.parametrize("mode", MODES)
def test_terms_add_up_to_the_formula(mode):
    """The term for progress is proportional to the distance, and each event counts once. In one case all four terms
    occur together, and in another one none.
    """
    price, goal, adversary, contact = table()[mode]
    terms = reward_terms(MODES[mode], np.array([0.5, 0.0]), *np.array([[True, False]] * 3))
    assert terms.shape == (len(TERMS), 2)
    assert terms.sum(axis=0).tolist() == pytest.approx([0.5 * price + goal + adversary + contact, 0.0])
    assert not np.signbit(terms[:, 1]).any()  # -0.0 would be printed as a penalty


def test_an_unknown_mode_is_named():
    with pytest.raises(ValueError, match="mode = 'exam': must be one of 'training', 'evaluation', 'test'"):
        check_mode("exam")
