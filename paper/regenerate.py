"""Regenerates all figures and tables of the paper from stored results.

Usage: python paper/regenerate.py [--results DIR] [--out DIR] [--jobs N]

Studies and timings that the results folder lacks are run first.  Two regenerations from the same
results give byte-identical files.
"""

import argparse
import sys
from pathlib import Path

from vehiclemor import VehiclemorError
from vehiclemor.report.regenerate import regenerate_all


def main() -> int:
    """Regenerate everything; wrong input is one line and exit status 2."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--results", type=Path, default=Path("results"), help="results folder")
    parser.add_argument("--out", type=Path, default=Path("results"), help="folder for the files")
    parser.add_argument("--jobs", type=int, default=1, help="processes for missing studies")
    arguments = parser.parse_args()
    try:
        for path in regenerate_all(arguments.results, arguments.out, arguments.jobs):
            print(path)
    except VehiclemorError as error:
        print(f"regenerate: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
