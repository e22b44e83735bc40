"""Equations as Dakhlallah, Glaser, Mammar & Sebsadji (2008) print them, in place of corrected ones.

What is wrong with each stands at the corrected form, in `gripbench.methods.dugoff_ekf`.
"""

from __future__ import annotations

from gripbench.compilation import compiled
from gripbench.methods.blocks.dugoff_tyre import dugoff_slips
from gripbench.methods.dugoff_ekf import advance, transition
from gripbench.methods.settings import Variant


@compiled
def printed_slips(rolling, speed, lateral):
    """Return the slips of eq. 2 and 4 with 1 - lambda; arguments and result as `dugoff_slips`."""
    if rolling >= speed:
        return dugoff_slips(rolling, speed, lateral)
    base = 2.0 * speed - rolling
    return (
        (rolling - speed) / base,
        -lateral / base,
        -rolling / (base * base),
        2.0 * lateral / (base * base),
        -1.0 / base,
    )


@compiled
def printed_transition(state, elapsed):
    """Write F of eq. 11 as the Jacobian of f alone: without the tyres."""
    x, F = state.filter.x, state.filter.F
    F[0, 0], F[0, 1], F[0, 2] = 1.0, elapsed * x[2], elapsed * x[1]
    F[1, 0], F[1, 1], F[1, 2] = -elapsed * x[2], 1.0, -elapsed * x[0]
    F[2, 0], F[2, 1], F[2, 2] = 0.0, 0.0, 1.0


@compiled
def euler_step(state, obs, params, elapsed):
    """Advance the states by forward Euler on the older sample's inputs, eq. 11."""
    x = state.filter.x
    x[0] += elapsed * state.rate[0]
    x[1] += elapsed * state.rate[1]
    x[2] += elapsed * state.rate[2]


@compiled
def printed_update(state, obs, params, elapsed):
    """Leave the states to eq. 12, which starts from x(k-1|k-1); without a correction, advance."""
    if params.correction == 0.0:
        advance(state, obs, params, elapsed)


@compiled
def printed_step_and_update(state, obs, params, elapsed):
    """Do as `printed_update`, but advance by forward Euler."""
    if params.correction == 0.0:
        euler_step(state, obs, params, elapsed)


def _unread(settings):
    # neither the forecast nor its covariance counts, so the yaw model is without effect
    return ("yaw_inertia",) if settings["correction"] else ()


_SLIPS = {dugoff_slips: printed_slips}
_JACOBIAN = {transition: printed_transition}
_TRACK = {"load_transfer_track": 0.5}

FORMS = {
    "dugoff_ekf": {
        "paper": Variant(
            _TRACK,
            functions=_SLIPS | _JACOBIAN | {advance: printed_step_and_update},
            unread=_unread,
        ),
        "paper_step": Variant(functions={advance: euler_step}),
        "paper_slip": Variant(functions=_SLIPS),
        "paper_load_transfer": Variant(_TRACK),
        "paper_jacobian": Variant(functions=_JACOBIAN),
        "paper_update": Variant(functions={advance: printed_update}),
    }
}
"""Variants with printed equations, by method."""
