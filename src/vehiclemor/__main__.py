"""`python -m vehiclemor`: the command line."""

import sys

from vehiclemor.cli import main

sys.exit(main())
