"""Warnings in the form in which commands print them."""

import warnings

import pytest

from evolve.cli import main as command
from evolve.cli.notes import notes
from sim.scene.mirror import MirrorWarning


def warn_from_two_places(text):
    warnings.warn(text, MirrorWarning, stacklevel=1)
    warnings.warn(text, MirrorWarning, stacklevel=1)


def test_what_is_warned_of_twice_is_said_once(capsys):
    with warnings.catch_warnings(), notes():
        warnings.simplefilter("always")
        warn_from_two_places("not mirrored:\n  a flex")
        warn_from_two_places("not mirrored: a skin")
    assert capsys.readouterr().err.splitlines() == ["note: not mirrored: a flex", "note: not mirrored: a skin"]


def test_others_warnings_are_pythons():
    with warnings.catch_warnings(record=True) as seen, notes():
        warnings.simplefilter("always")
        warnings.warn("from another library", UserWarning, stacklevel=1)
        warnings.warn("from another library", UserWarning, stacklevel=1)
    assert [str(each.message) for each in seen] == ["from another library"] * 2


def test_commands_say_them_so_and_afterwards_python_does(capsys, monkeypatch):
    python = warnings.showwarning

    def outcome(arguments):
        warn_from_two_places("not mirrored: a flex")
        return 0

    monkeypatch.setattr(command, "_outcome", outcome)
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        python = warnings.showwarning
        assert command.main(["genes"]) == 0
        assert warnings.showwarning is python
    assert capsys.readouterr().err == "note: not mirrored: a flex\n"


def test_an_error_gives_python_its_warnings_back():
    python = warnings.showwarning
    with pytest.raises(ZeroDivisionError), notes():
        raise ZeroDivisionError
    assert warnings.showwarning is python
