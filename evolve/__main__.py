"""Entry point of `python -m evolve`. Other modules are imported only after Ctrl-C is handled."""

import sys


def main() -> int:
    """Import the module of the command, run the command, and return its exit code."""
    try:
        from evolve.cli.main import main as command

        return command()
    except KeyboardInterrupt:  # Ctrl-C during the import
        print("evolve: interrupted", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
