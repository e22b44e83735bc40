"""Papers whose claims are run again, one module a paper with `reproduce(progress, seeds)`."""
