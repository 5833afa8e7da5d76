"""The program `drumsqueal`, or `python -m drumsqueal`: it loads the command line and runs it."""

import sys


def main() -> None:
    """Run the command line; Ctrl-C while it loads is told in one line, too."""
    try:
        from drumsqueal.cli import main as run
    except KeyboardInterrupt:
        sys.exit("drumsqueal: interrupted before anything was written")
    run()


if __name__ == "__main__":
    main()
