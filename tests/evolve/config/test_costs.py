"""Prices: costs counted by hand, refused values, and fingerprints."""

from dataclasses import replace

import pytest

from evolve.config.assemble import assemble, from_text, to_toml
from evolve.config.checks import ConfigError
from evolve.config.costs import CostsConfig, neuron_count, receptor_count
from evolve.config.run_config import EyeConfig
from evolve.store.versions import fingerprint
from tests.evolve.closed_form import tiny
from tests.evolve.small_run import PHENOTYPE

# Two eyes of 4 x 5 positions, and a brain with two hidden layers of 16 neurons.
ANIMAL = replace(PHENOTYPE, layers=2, neurons=16)


@pytest.mark.parametrize(("receptors", "types"), [("rgb", 3), ("lms", 3), ("goldfish", 4)])
def test_each_type_at_a_position_is_a_receptor(receptors, types):
    eye = EyeConfig(receptors=receptors)
    assert receptor_count(ANIMAL, eye) == 2 * 4 * 5 * types
    assert receptor_count(ANIMAL, eye) == ANIMAL.n_eyes * ANIMAL.eyes(eye).eye().channels * 4 * 5


def test_inherited_types_count_by_animal():
    eye = EyeConfig(receptors="genes")
    for peaks in ((600.0,), (600.0, 520.0, 460.0, 360.0)):
        assert receptor_count(replace(ANIMAL, lambda_max_nm=peaks), eye) == 2 * 4 * 5 * len(peaks)


def test_neurons_are_those_of_the_hidden_layers():
    assert neuron_count(ANIMAL) == 32
    assert neuron_count(replace(ANIMAL, layers=3, n_eyes=9)) == 48


def test_costs_are_the_sum_of_the_prices():
    assert CostsConfig(0.5, 10, 0.25).total(ANIMAL, EyeConfig()) == 0.5 * 120 + 10 * 2 + 0.25 * 32
    assert CostsConfig().total(ANIMAL, EyeConfig()) == 0


def test_height_costs_by_its_receptors_alone():
    """A higher field of view is free; further rows of receptors are not."""
    costs, eye = CostsConfig(per_receptor=1.0), EyeConfig(vertical_fov="gene")
    low, high = (costs.total(replace(ANIMAL, vertical_fov_deg=fov), eye) for fov in (10.0, 90.0))
    assert low == high
    assert costs.total(replace(ANIMAL, resolution=(8, 5)), eye) == 2 * low


@pytest.mark.parametrize("name", ["per_receptor", "per_eye", "per_neuron"])
@pytest.mark.parametrize(
    ("price", "says"),
    [
        ("-0.1", "-0.1: must be in [0, 1000]"),
        ("nan", "nan: must be in [0, 1000]"),
        ("inf", "inf: must be in [0, 1000]"),
        ("1001", "1001: must be in [0, 1000]"),
        ('"cheap"', "'cheap': must be a number in [0, 1000]"),
        ("true", "true: must be a number in [0, 1000]"),
    ],
)
def test_bad_prices_are_refused(name, price, says):
    with pytest.raises(ConfigError) as error:
        assemble("detection", assignments=[f"costs.{name}={price}"])
    assert str(error.value) == f"--set: costs.{name} = {says}"


@pytest.mark.parametrize("price", ["-1", "nan", "dear"])
def test_the_command_refuses_them_in_a_line(call, tmp_path, price):
    file = tmp_path / "prices.toml"
    value = f'"{price}"' if price == "dear" else price
    file.write_text(f"[costs]\nper_eye = 1.0\nper_receptor = {value}\n")
    code, out, err = call("run", "detection", "--config", file, "--out", tmp_path / "run")
    assert (code, out) == (2, "")
    assert err.startswith(f"evolve: error: {file}, line 3: costs.per_receptor = ")
    assert err.count("\n") == 1
    assert not (tmp_path / "run").exists()


def test_an_unknown_price_is_refused():
    with pytest.raises(ConfigError, match=r"unknown key 'costs\.per_eyes'; did you mean 'per_eye'"):
        assemble("detection", assignments=["costs.per_eyes=1"])


def test_settings_read_back_and_old_files_have_no_costs():
    priced = tiny("costs.per_eye=0.1")
    assert from_text(to_toml(priced)) == priced
    former = to_toml(tiny()).partition("[costs]")[0]
    assert from_text(former) == tiny()
    assert from_text(former).costs.free


def test_fingerprints_change_with_costs():
    assert fingerprint(to_toml(tiny("costs.per_receptor=0.01"))) != fingerprint(to_toml(tiny()))
