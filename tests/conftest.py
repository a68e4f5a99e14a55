"""What tests of several packages share."""

import pytest


@pytest.fixture(scope="module")
def short_episodes():
    """Episodes of 32 actions, not 256: for what does not depend on their length, and needs many of them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sim.envs.simulation.EPISODE_STEPS", 32)
        yield
