"""Import and build what every worker needs; imported once by the process from which the workers are forked."""

import scipy.interpolate  # noqa: F401 - the first spline would import it
from threadpoolctl import threadpool_limits

import app.worker  # noqa: F401
import linkage_atlas as la
from app.query import build_models

threadpool_limits(1, "blas")
build_models()
la.prepare()
