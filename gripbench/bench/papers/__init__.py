"""The papers: published numbers and claims beside ours, one folder a paper."""
