"""Entry point of `python -m evolve`, which is the command `evolve`."""

import sys

from rhabdom.command import run_command

if __name__ == "__main__":
    sys.exit(run_command())
