"""Published claims are checked against their bounds, and a wrong answer is named."""

import sys
from dataclasses import replace

import numpy as np

from validation.peers import peer_claims
from validation.peers.claims import claim as systems
from validation.peers.claims.textbook_aberrations import of_wavefronts
from validation.peers.claims.textbook_apertures import of_circles


def test_page_is_written_and_every_claim_holds(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["peer_claims", "--out", str(tmp_path), "--docs", str(tmp_path)])
    assert peer_claims.main() == 0
    page = (tmp_path / "peer_claims.md").read_text()
    assert "claims without a counterpart here" in page
    assert (tmp_path / "peer_claims.png").stat().st_size > 10_000


def test_there_are_enough_claims_of_several_sources():
    asked = list(peer_claims.cases())
    assert len(asked) >= peer_claims.FEWEST
    sources = {each.source.split()[0].rstrip(",") for each in asked}
    assert {"brandondube/prysm", "ehpor/hcipy", "spacetelescope/poppy", "Goodman", "Born", "Mahajan"} <= sources


def test_a_wrong_wavelength_is_noticed(monkeypatch):
    """Every dark ring is displaced if the wavelength is 1 % too long."""
    monkeypatch.setattr(systems, "UNIT", 1.01 * systems.UNIT)
    asked = [each for each in of_circles() if each.says.startswith("dark ring")]
    assert len(peer_claims.answered(asked)[2]) == len(asked) == 3


def test_what_is_off_is_named():
    (first, *_) = of_wavefronts()
    wrong = replace(first, theirs=first.theirs + 10 * first.bound)
    shares, table, broken = peer_claims.answered([first, wrong])
    assert len(broken) == 1
    assert first.says in broken[0]
    assert np.array(shares)[0] < 1 < np.array(shares)[1]
    assert "2 claims, 1 hold" in table
