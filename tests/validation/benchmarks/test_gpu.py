"""The comparison of devices, tested without a GPU: the results that a child process writes, and the rows of the
table."""

import json

import numpy as np
import pytest

from validation.benchmarks.gpu import PLACES, Case, child, chosen, design, row


def test_a_child_measures_what_is_chosen(tmp_path, monkeypatch):
    def refuse():
        raise ValueError

    monkeypatch.setattr("validation.benchmarks.gpu.CASES", (*chosen(["PSF, 65"]), Case("refused", lambda: refuse)))
    monkeypatch.setattr("validation.benchmarks.gpu.BUDGET", 0.0)
    child("cpu", [], tmp_path)
    numbers, arrays = json.loads((tmp_path / "cpu.json").read_text()), np.load(tmp_path / "cpu.npz")
    assert min(numbers["PSF, 65 x 65 samples"].values()) > 0
    assert set(numbers["PSF, 65 x 65 samples"]) == {"first", "seconds"}
    assert arrays["PSF, 65 x 65 samples"].shape == (1, 65, 65)
    assert numbers["refused"] == {"failed": "ValueError: "}


def test_rows():
    spent = {"cpu": {"looks": {"seconds": 0.02}}, "cuda": {"looks": {"seconds": 0.005, "first": 1.0}}}
    found = {place: {"looks": np.array([2.0, value])} for place, value in zip(PLACES, (1.0, 1.5), strict=True)}
    assert row("looks", spent, found) == "| looks | 20 | 5 | 4 | 1 | 2.5e-01 |"
    spent["cuda"]["looks"] = {"failed": "ValueError: no"}
    assert row("looks", spent, found) == "| looks | works | ValueError: no | | |"


@pytest.mark.parametrize(("gradient", "shape"), [(False, (8, 65, 65)), (True, (32, 32))])
def test_designs_repeat_their_results(gradient, shape):
    call = design(1, gradient)()
    first, second = call(), call()
    assert first.shape == shape
    assert np.abs(first).max() > 0
    np.testing.assert_array_equal(first, second)


def test_one_word_selects_512_psfs():
    assert len(chosen(["512 PSFs"])) == 3
