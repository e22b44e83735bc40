"""Trivial estimators through the same contract: what every other method has to beat."""
