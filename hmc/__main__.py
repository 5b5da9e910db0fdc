"""``python -m hmc``."""

import sys

from hmc.cli import main

sys.exit(main())
