"""`python -m exactarm` is the command `exactarm`."""

import sys

from exactarm.cli import main

sys.exit(main())
