"""``python -m asterism.cli`` is ``asterism``."""

import sys

from asterism.cli import main

sys.exit(main())
