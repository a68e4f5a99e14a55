"""Implementations of the commands of `evolve`; `evolve.cli.main` imports their modules on use."""

INTERRUPTED = 130  # exit code after Ctrl-C, by the convention of shells
