"""filterpy's filter comes without scipy.stats, and filterpy is whole all the same."""

import subprocess
import sys

CHECK = """
import sys
from survey.estimation.filterpy_filter import extended_kalman_filter

ekf = extended_kalman_filter(2, 1)
assert type(ekf).__module__ == "filterpy.kalman.EKF"
assert "scipy.stats" not in sys.modules
import numpy as np
ekf.update(np.ones(1), HJacobian=lambda x: np.ones((1, 2)), Hx=lambda x: x[:1] + x[1:])
likelihood = ekf.log_likelihood
import scipy.stats
from scipy.stats import multivariate_normal
assert sys.modules["scipy.stats"] is scipy.stats
expected = multivariate_normal.logpdf(ekf.y.ravel(), cov=ekf.S)
assert abs(likelihood - expected) < 1e-12, (likelihood, expected)
import filterpy.stats
assert abs(filterpy.stats.norm_cdf((-1.0, 1.0), 0.0, std=1.0) - 0.6826894921370859) < 1e-12
"""


def test_scipy_stats_is_loaded_only_when_it_is_used():
    subprocess.run([sys.executable, "-c", CHECK], check=True)


def test_a_loaded_scipy_stats_stays_what_it_is():
    check = "import scipy.stats as before\n" + CHECK.replace(
        'assert "scipy.stats" not in sys.modules\n', ""
    )
    subprocess.run([sys.executable, "-c", check + "assert scipy.stats is before"], check=True)
