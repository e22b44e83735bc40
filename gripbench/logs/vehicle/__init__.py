"""Recordings in, what they tell of their vehicle and its sensors out."""
