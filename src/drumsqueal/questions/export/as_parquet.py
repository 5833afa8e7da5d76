"""Parquet: a column for the time and for each signal; units and texts in the metadata. Needs the extra "parquet"."""

from pathlib import Path

import pyarrow
import pyarrow.parquet

from drumsqueal.progress import Progress
from drumsqueal.questions.export.channels import Channels


def write(channels: Channels, path: Path, progress: Progress) -> str:
    """Write the columns, `units` and `meaning` in the metadata of each and the texts in that of the file.

    Raises OSError.
    """
    fields = [pyarrow.field("time", pyarrow.float64(), nullable=False, metadata={"units": "s"})]
    for channel in channels.channels:
        described = {"units": channel.units, "meaning": channel.meaning}
        fields.append(pyarrow.field(channel.name, pyarrow.float64(), nullable=False, metadata=described))
    texts = channels.texts | {
        "sample_rate": repr(channels.sample_rate),
        "eigenvalues": "\n".join(channels.prediction),
    }
    columns = [channels.time, *(channel.values for channel in channels.channels)]
    table = pyarrow.Table.from_arrays(
        [pyarrow.array(column) for column in columns], schema=pyarrow.schema(fields, metadata=texts)
    )
    progress("writing", 0.0, None)
    with path.open("wb") as file:
        pyarrow.parquet.write_table(table, file)
    return ""
