"""gripbench: a benchmark of estimators of tyre-road friction and vehicle sideslip."""

__version__ = "0.1.0"
