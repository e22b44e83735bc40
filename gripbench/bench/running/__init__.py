"""A plan into rows: cells, execution, sandbox, backends, store and keys."""
