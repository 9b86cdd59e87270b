"""``python -m asterism.app`` is ``asterism``."""

import sys

from asterism.app import main

sys.exit(main())
