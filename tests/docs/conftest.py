"""The scripts that write pages and their figures can be imported by name."""

import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs"
sys.path[:0] = [str(DOCS / "extensions"), str(DOCS / "scripts")]
