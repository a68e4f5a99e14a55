"""`evolve`, and python -m evolve. Nothing else is loaded before Ctrl-C is looked after."""

import sys


def main() -> int:
    """Load the command and run it; returns the exit code."""
    try:
        from evolve.cli.main import main as command

        return command()
    except KeyboardInterrupt:  # while it was being loaded
        print("evolve: interrupted", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
