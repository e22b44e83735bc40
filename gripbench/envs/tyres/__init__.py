"""Tyre formulas."""
