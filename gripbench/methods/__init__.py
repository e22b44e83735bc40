"""The estimators: one method a file, and the contract that they share."""
