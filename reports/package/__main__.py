"""Run the command line: `python -m crossbody` does what `crossbody` does."""

from crossbody.reports.entry import main

if __name__ == "__main__":
    main()
