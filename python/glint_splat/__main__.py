"""Trains the parts of a plan on many machines: python -m glint_splat cluster|slurm PLAN -o SCENE."""

import sys

from .cluster import main

sys.exit(main())
