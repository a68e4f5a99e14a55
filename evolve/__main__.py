"""python -m evolve"""

import sys

if __name__ == "__main__":
    try:
        from evolve.cli.main import main

        code = main()
    except KeyboardInterrupt:  # while it was being loaded
        print("evolve: interrupted", file=sys.stderr)
        code = 130
    sys.exit(code)
