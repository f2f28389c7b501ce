"""`python -m harness` is the command `forcechain`."""

import sys

from harness.cli import main

sys.exit(main())
