"""One module for each group of commands; each has `register(app)`. `--help` groups them by job."""

REPRODUCE = "Reproduce a paper"
RUN = "Run methods"
RANK = "Rank them"
PUBLISH = "Publish results"
LOGS = "Logs of real vehicles"
