"""Compiles the paper: `paper/paper.typ` to `paper/build/paper.pdf`.

Usage: python paper/compile.py
"""

import sys
import time
from pathlib import Path

import typst

PAPER = Path(__file__).parent


def main() -> int:
    """Write the PDF; a number or reference that is missing ends it with exit status 1."""
    start, target = time.perf_counter(), PAPER / "build" / "paper.pdf"
    target.parent.mkdir(exist_ok=True)
    try:
        # Fonts are those of typst, so that the pages are the same on every machine.
        typst.compile(
            PAPER / "paper.typ", output=target, root=PAPER.parent, ignore_system_fonts=True
        )
    except typst.TypstError as error:
        print(error.diagnostic, file=sys.stderr)
        return 1
    print(f"{target} in {time.perf_counter() - start:.1f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
