"""What is in a log and what its columns are: the map, its tables, units, and a proposal of one."""
