"""What there is: the registry, what a method declares, its checks, the templates of new files."""
