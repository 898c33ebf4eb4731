"""What a cycle asks of each drive, and which motors and ratios serve."""
