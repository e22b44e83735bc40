"""The plants: right-hand sides, integrators and their simulations."""
