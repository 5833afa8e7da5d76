"""What accuracy costs in the nominal scene, as users ask for it: the pictures of docs/accuracy.md."""

import shutil
import subprocess
import sys
from pathlib import Path

from .record import Record
from .scenes import SCENARIOS


def measure(record: Record, folder: Path) -> None:
    """Run the study, print what it prints, and keep its pictures."""
    results = folder / "accuracy"
    command = [sys.executable, "-m", "drumsqueal", "accuracy", str(SCENARIOS / "nominal.toml"), "--target", "1e-4"]
    done = subprocess.run([*command, "-o", str(results), "--overwrite"], check=True, capture_output=True, text=True)
    record.say(done.stdout)
    for picture in results.glob("accuracy_*.png"):
        shutil.copy(picture, folder)
