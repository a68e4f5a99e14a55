"""Entry point of `evolve` and `python -m evolve`; nothing else is imported before Ctrl-C is handled."""

import sys


def main() -> int:
    """Import the command, run it, and return the exit code."""
    try:
        from evolve.cli.main import main as command

        return command()
    except KeyboardInterrupt:  # during the import
        print("evolve: interrupted", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
