"""Columns in, signals in SI units at the centre of gravity, each with its own times, out."""
