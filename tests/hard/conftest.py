"""What the tests of this folder share is in `bodies.py` next to them."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
