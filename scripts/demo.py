"""Stiffness of the 3-PRUP at a pose, each module's share, and pictures in out/; run by demo.sh.

Arguments after the script's name go to `prup-pin stiffness` and replace the pose and the load of the demo.
"""

import shlex
import sys
from pathlib import Path

from prup_pin.cli import main

OUT = Path(__file__).resolve().parent.parent / "out"
DEMO = ["3prup", "--at", "z=0.4,theta=25deg,phi=15deg", "--wrench", "fx=300,mz=100"]

if __name__ == "__main__":
    arguments = ["stiffness", *(sys.argv[1:] or DEMO), "--pictures", str(OUT)]
    print(f"\n$ prup-pin {shlex.join(arguments[:-1])} out\n", flush=True)
    sys.argv = ["prup-pin", *arguments]
    main()
