"""Untrusted run directories: a short version of validation/evolve/hostile.py, which must detect a broken guarantee."""

import pytest

from validation.evolve import hostile, hostile_files, hostile_runs


def test_promises_hold(capsys):
    assert hostile.main(["--trials", "60", "--seed", "7"]) == 0
    trials, failed = map(int, capsys.readouterr().out.splitlines()[-1].split()[-2:])
    assert trials > 50
    assert failed == 0


def test_trials_repeat_by_their_seed(tmp_path):
    stage = hostile_runs.Stage.build(tmp_path)
    found = [hostile.failures(hostile.Promise("", told, 1.0), 3, seed, stage) for seed in (1, 1, 2)]
    assert found[0] == found[1] != found[2]


def told(chance, stage):
    return str(chance.random())


BROKEN = {
    "links followed": (hostile_runs.strange_file, "evolve.store.directory._require_plain", lambda path: None),
    "values unchecked": (
        hostile_runs.impossible_value,
        "evolve.store.candidate.Phenotype.from_json",
        lambda value: value,
    ),
    "ranges unchecked": (
        hostile_runs.shape_bomb,
        "evolve.genome.phenotype_on_record._of_gene",
        lambda g, k, value: value,
    ),
    "escapes obeyed": (hostile_runs.steering_text, "evolve.runs.output.printable", str),
    "text unescaped": (hostile_files.text_on_a_page, "evolve.report.markup._escaped", str),
    "policies unchecked": (hostile_files.forged_policy, "evolve.learning.policy._require_shape", lambda *_: None),
    "places unchecked": (hostile_files.bomb_of_a_model, "sim.scene.source.require_finite", lambda *_: None),
}


@pytest.mark.parametrize("how", BROKEN)
def test_a_broken_promise_is_noticed(tmp_path, monkeypatch, how):
    trial, door, instead = BROKEN[how]
    stage = hostile_runs.Stage.build(tmp_path)
    promise = hostile.Promise(how, trial, 1.0)
    assert not hostile.failures(promise, 12, 3, stage)
    monkeypatch.setattr(door, instead)
    assert hostile.failures(promise, 12, 3, stage)
