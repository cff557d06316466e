"""``python -m hemivar``."""

from __future__ import annotations

import sys

from hemivar.cli import main

if __name__ == "__main__":
    sys.exit(main())
