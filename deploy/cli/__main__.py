"""`python -m deploy.cli` is `swarmtouch`."""

import sys

from deploy.cli import main

sys.exit(main())
