"""Sizing of drives: forces, speeds and energy over a cycle, and the motors and ratios that serve."""
