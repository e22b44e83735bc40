"""Pictures: the result figures of the papers by number, and plots of any run."""
