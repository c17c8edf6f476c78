"""`python -m benchmarks.sealed OUT --answers FOLDER`."""

import sys

from .generate import main

sys.exit(main())
