"""`python -m surfabet`, for where the command itself is not on the path."""

import sys

from surfabet.cli import main

sys.exit(main())
