"""A lost or exchanged policy is detected, and the message gives a remedy."""

from dataclasses import replace

import numpy as np
import pytest

from evolve.search.local_executor import LocalExecutor
from evolve.search.loop import evolve
from evolve.store.atomic_files import write_whole
from evolve.store.checksums import digest
from evolve.store.directory import Run, RunError
from evolve.store.policies import lost, require_policy
from tests.evolve.closed_form import leaves_a_policy, tiny
from tests.evolve.conftest import Silent
from tests.evolve.store.records import candidate


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    run = Run.create(tmp_path_factory.mktemp("trained") / "run", tiny("search.generations=1"))
    with LocalExecutor(leaves_a_policy, 1) as executor:
        evolve(run, executor, Silent())
    return run.path


def test_checksums_are_on_record_and_policies_that_are_there_are_not_lost(trained):
    run = Run.open(trained)
    assert run.notice is None
    for one in run.candidates:
        assert one.policy == digest(run.policy_path(one.id))
        require_policy(one, run.policy_path(one.id))
    assert len({one.policy for one in run.candidates}) == 4


def test_lost_policies_are_noticed_at_once(run, call):
    for number in range(8):
        run.append(replace(candidate(number), policy="00" * 32))
        write_whole(run.policy_path(number), b"policy")
    assert Run.open(run.path).notice is None
    for number in (1, 2, 3, 5, 6, 7):
        run.policy_path(number).unlink()
    notice = Run.open(run.path).notice
    assert "policies of 6 candidates are lost (1, 2, 3, 5, 6, ...): restore the file from a copy" in notice
    assert notice in call("status", run.path)[2]
    assert lost([candidate(1)], run.policy_path) is None, "records of an earlier version contain no hash"


def test_an_exchanged_policy_is_not_played(run):
    run.append(replace(candidate(0), policy="00" * 32))
    with pytest.raises(RunError, match=r"no policy at .*000000\.safetensors: restore the file"):
        require_policy(run.candidates[0], run.policy_path(0))
    write_whole(run.policy_path(0), b"another")
    with pytest.raises(RunError, match="is not the policy with which candidate 0 was evaluated: restore the file"):
        require_policy(run.candidates[0], run.policy_path(0))
    require_policy(candidate(0), run.policy_path(0))


def test_a_policy_that_never_was_is_not_looked_for_in_copies(run):
    for one, message in (
        (candidate(0, -np.inf, "rewards are not finite"), r"^candidate 0 has no policy, as it failed: rewards are"),
        (candidate(1), r"^no policy at .*000001\.safetensors, and none is on record: choose another"),
    ):
        with pytest.raises(RunError, match=message) as caught:
            require_policy(one, run.policy_path(one.id))
        assert "copy" not in str(caught.value)


def test_the_policy_of_an_earlier_stage_is_not_played_for_one_that_failed_later(run):
    write_whole(run.policy_path(0), b"of the first rung")
    with pytest.raises(RunError, match="candidate 0 has no policy, as it failed: loss not finite"):
        require_policy(candidate(0, -np.inf, "loss not finite"), run.policy_path(0))
