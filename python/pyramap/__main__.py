"""`python -m pyramap` is the command `pyramap`."""

from .cli import main

main()
