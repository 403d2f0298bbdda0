"""`python -m prup_pin` is `prup-pin`: an interrupt ends it without a traceback, while its libraries load too."""

import signal
import sys


def main() -> None:
    """Run the command line."""
    own = signal.getsignal(signal.SIGINT)
    if own is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # libraries that are half loaded make other errors of it
    from .cli import main as run

    signal.signal(signal.SIGINT, own)
    try:
        run()
    except KeyboardInterrupt:
        sys.exit(128 + signal.SIGINT)


if __name__ == "__main__":
    main()
