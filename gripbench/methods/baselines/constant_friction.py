"""Constant friction: no sample in, the same coefficient out; dry asphalt, or the population's mean.

Whatever does not beat a constant has not seen the road. The default is .8 (dry asphalt, Wong,
Theory of Ground Vehicles, Table 1.3: peak .8 to .9); the variant `prior` gives mean and variance
of the population that the drive comes from, the best that can be said before it begins.
"""

from __future__ import annotations

import numpy as np

from gripbench.methods.contract import CompiledMethod, Parameter, Variant, compiled


@compiled
def _write(est, mu, variance):
    est.mu, est.mu_front, est.mu_rear = mu, mu, mu
    est.mu_variance, est.mu_front_variance, est.mu_rear_variance = variance, variance, variance


@compiled
def _step(state, obs, params, est):
    _write(est, params.friction, params.friction_std**2)


@compiled
def _step_prior(state, obs, params, est):
    _write(est, params.friction_prior, params.friction_prior_std**2)


class ConstantFriction(CompiledMethod):
    """The same friction coefficient always."""

    name = "constant_friction"
    title = "Constant friction"
    reference = "Baseline; Wong, Theory of Ground Vehicles, Table 1.3"
    baseline = True
    sensors = ()
    estimates = ("mu", "mu_front", "mu_rear")
    variances = ("mu", "mu_front", "mu_rear")
    parameters = (
        Parameter("friction", 0.8, "-", "Friction coefficient", 0.01, 2.0),
        Parameter("friction_std", 0.3, "-", "Standard deviation of its error", 0.001, 2.0),
    )
    variants = {
        "prior": Variant(
            step=_step_prior, vehicle_parameters=("friction_prior", "friction_prior_std")
        )
    }
    state = np.dtype([("unused", np.float64)])
    step = staticmethod(_step)
