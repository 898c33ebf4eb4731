"""`python -m pteron`: the command line."""

from pteron_command import main

main()
