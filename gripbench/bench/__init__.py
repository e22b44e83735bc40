"""The harness: registry, runner, metrics, statistics, store, tables and the command line."""
