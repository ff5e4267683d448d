"""`python -m throwcollect` is the command line."""

from throwcollect.cli.main import main

if __name__ == "__main__":
    main()
