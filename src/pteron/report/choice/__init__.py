"""The page on a choice of machines, with its numbers and the machines' files."""
