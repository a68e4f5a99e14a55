"""Signals at a near edge agree with Mitsuba's thin lens."""

from dataclasses import replace
from pathlib import Path

import pytest

from validation.pages.page import blanked
from validation.sim import occlusion_against_thin_lens as proof


@pytest.fixture(scope="module")
def plate():
    return proof.measure("plate", proof.NEAR, samples=2000)


def test_occlusion_agrees_with_rays(plate):
    assert proof.broken_bounds([plate]) == []
    assert plate.error_without > 5 * plate.error.max()


def test_light_that_is_added_is_noticed(plate):
    [words] = proof.broken_bounds([replace(plate, seen=plate.added)])
    assert words.startswith("plate: errors up to 0.2")
    [words] = proof.broken_bounds([replace(plate, added=plate.seen)])
    assert words.startswith("plate: without occlusion")


@pytest.mark.slow
def test_occlusion_figure_and_page(tmp_path, capsys):
    assert proof.main(["--out", str(tmp_path), "--docs", str(tmp_path)]) == 0
    name = "occlusion_against_thin_lens"
    assert (tmp_path / f"{name}.png").stat().st_size > 10_000
    fresh, stored = ((path / f"{name}.md").read_text() for path in (tmp_path, Path("docs/validation")))
    assert blanked(fresh) == blanked(stored)
    assert "all bounds hold" in capsys.readouterr().out
