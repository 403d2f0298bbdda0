"""What every reader of logs must hold, as checks that raise AssertionError of one that does not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ..errors import RecordingFileError
from ..imports.log import Log
from .contract import contract, require

Read = Callable[[Path], Log]


@contract("read")
def check_log(read: Read, path: Path) -> None:
    """A log has streams of read-only columns of one length, with unique names, and is the same each time."""
    log, again = read(path), read(path)
    require(isinstance(log, Log), f"It returned {type(log).__name__}; expected a Log.")
    require(log.streams and log.names, "It has no columns.")
    require(len(set(log.names)) == len(log.names), f"Names stand in it twice: {', '.join(log.names)}.")
    require(log.names == again.names, "Read again it has other columns.")
    for stream, other in zip(log.streams, again.streams, strict=True):
        require(set(stream.units) <= set(stream.columns), f"Units are given of {set(stream.units)}, no columns.")
        for name, values in stream.columns.items():
            what = f"Column '{name}'"
            fits = isinstance(values, np.ndarray) and values.dtype == float and values.shape == (len(stream),)
            require(fits, f"{what} is no array of {len(stream)} floats, as its stream has.")
            require(not values.flags.writeable, f"{what} can be written to; `frozen` makes columns.")
            require(not np.isinf(values).any(), f"{what} is infinite; `frozen` makes nan of that.")
            require(np.array_equal(values, other.columns[name], equal_nan=True), f"{what} differs when read again.")
        if stream.clock is not None:
            require(np.isfinite(stream.clock).all(), f"The clock of '{stream.name}' is no number somewhere.")


@contract("read")
def check_damaged(read: Read, path: Path) -> None:
    """A file that is empty, cut off or overwritten is refused by RecordingFileError with its name, or read."""
    whole = path.read_bytes()
    noise = np.random.default_rng(1).integers(0, 256, len(whole), dtype=np.uint8).tobytes()
    half = len(whole) // 2
    with TemporaryDirectory() as folder:
        damaged = Path(folder) / f"damaged{path.suffix}"
        for what, content in (
            ("An empty file", b""),
            ("One cut off in the middle", whole[:half]),
            ("One overwritten from the middle on", whole[:half] + noise[half:]),
            ("One of noise", noise),
        ):
            damaged.write_bytes(content)
            try:
                read(damaged)
            except RecordingFileError as error:
                require(damaged.name in str(error), f"{what} is refused without its name: {error}")
            except Exception as error:
                raise AssertionError(
                    f"{what} raises {type(error).__name__}: {error}; put what a library does into `with reading(...)`."
                ) from error
