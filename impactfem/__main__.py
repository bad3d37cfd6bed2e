"""``python -m impactfem`` is the command line."""

import sys

from impactfem.cli import main

sys.exit(main())
