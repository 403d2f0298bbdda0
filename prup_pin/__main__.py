"""`python -m prup_pin` is `prup-pin`."""

from .cli import main

if __name__ == "__main__":
    main()
