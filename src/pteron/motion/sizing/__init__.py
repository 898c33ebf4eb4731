"""Sizing of drives: forces and energy over a cycle, and the motors and ratios that suffice."""
