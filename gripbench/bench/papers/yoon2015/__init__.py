"""Yoon, Li & Ahn (2015): claims run again, figures, tyre identification."""
