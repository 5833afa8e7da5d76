"""The program `drumsqueal`, or `python -m drumsqueal`: it loads the command line and runs it."""

from drumsqueal.interrupts import note_interrupts


def main() -> None:
    """Run the command line, with Ctrl-C noted from the loading of it until Python has shut down."""
    note_interrupts()
    from drumsqueal.cli import main as run

    run()


if __name__ == "__main__":
    main()
