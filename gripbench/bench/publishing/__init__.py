"""Boards into tables, figures, report, leaderboard and history."""
