"""``python -m varcalc``: the command, for those whose shell does not find it."""

from varcalc_command import main

if __name__ == "__main__":
    main()
