"""One module for each group of commands; each has `register(app)`. `--help` groups them by job."""

REPRODUCE = "Reproduce a paper"
RUN = "Run methods"
RANK = "Rank them"
PUBLISH = "Publish results"
LOGS = "Logs of real vehicles"

ORDER = (
    "reproduce", "evidence", "figures", "run", "check", "outside", "plot", "catalogue",
    "rank", "consistency", "results",
)  # fmt: skip
"""Modules whose commands come first in `--help`, in this order."""
