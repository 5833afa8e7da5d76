"""What the studies' jobs share: what is kept where one is cut off, and rows as CSV."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from drumsqueal.errors import IntegrationError
from drumsqueal.files.output_folder import not_taken


@contextmanager
def told_what_is_kept(table: Path) -> Iterator[None]:
    """Turn Ctrl-C, a failure and a full disk into an IntegrationError that says where what was done until then is."""
    try:
        yield
    except KeyboardInterrupt:
        raise IntegrationError(f"interrupted by the user; {_kept(table)}") from None
    except IntegrationError as error:
        raise IntegrationError(f"{error}; {_kept(table)}") from None
    except OSError as error:
        raise IntegrationError(f"{not_taken(error, table.parent)}; {_kept(table)}") from None


def _kept(table: Path) -> str:
    return f"what was done until then is in {table}" if table.exists() else "nothing was kept"
