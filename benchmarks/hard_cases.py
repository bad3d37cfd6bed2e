"""The board of hard cases by all methods (a minute and a half of computing).

    python benchmarks/hard_cases.py [--out benchmarks/results]

Writes hard_cases.md and hard_cases.csv, as ``impactfem bench --hard`` does, with their stamp.
"""

import argparse
from pathlib import Path

from stamp import RESULTS, write_stamp

import impactfem


def main() -> None:
    """Run all cases and write the board."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=RESULTS)
    given = parser.parse_args()
    impactfem.studies.hard_cases(progress=print).save(given.out)
    write_stamp("hard_cases", folder=given.out)


if __name__ == "__main__":
    main()
