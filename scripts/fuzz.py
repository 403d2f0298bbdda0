"""Damaged and hostile robot files, recordings, logs, maps, plans, models and command lines, by the seed of the day.

    python scripts/fuzz.py [--seconds 60 | --count 30000] [--seed 20261122] [--kinds logs,maps] [--only 17]

Each must end, within ten seconds and some memory, in an answer without NaN or in one clear error of the package.
Whatever else happens is shown with the number that makes it again (--only), and the exit code is then 1: another
exception, a warning of numpy's, a process that dies, a file opened that nobody named. Needs Linux, and
the extra 'test'.
"""

from __future__ import annotations

import argparse
import ctypes
import faulthandler
import json
import multiprocessing
import os
import random
import re
import resource
import signal
import struct
import sys
import tempfile
import time
import traceback
import warnings
import zipfile
from collections import Counter
from collections.abc import Iterator
from datetime import datetime, timezone
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

import h5py
import numpy as np
import pyarrow
import scipy.io
from pyarrow import parquet
from typer.testing import CliRunner

import prup_pin
from prup_pin.cli import app
from prup_pin.errors import PrupPinError
from prup_pin.imports import convert, guess, read_log, read_map
from prup_pin.recordings import read_plan, read_recording, read_tolerances, write_recording
from prup_pin.simulation import read_model
from tests.importing import logs

#: Longest time of one input [s], and the memory that a process may take [bytes].
LONGEST, MEMORY = 10, 6 * 2**30
#: What people and programs put where a number or a name should be.
ODD = ("", "0", "-1", "1e-300", "1e300", "-1e308", "1e9", "nan", "inf", "1,5", "a", "0 0 0", "1 2", "\u00b5", "x" * 400,
       "-0.0", "<", "null", "true", "[]", "{}", "[1, 2]", '{"a": 1}', "9" * 5000, "\x00", "\udc80", "*a", "&a [*a]",
       "2020-13-45", "!!python/name:os.system", "../../secret", "=1+1", '"')  # fmt: skip
ROBOTS = (*(ROOT / "examples").glob("*.urdf"), *(ROOT / "tests" / "robots").rglob("*.xml"))
SIDECARS = tuple((ROOT / "tests" / "robots").rglob("robot.yaml"))
RECORDING = """time,q.left_motor,q.right_motor,w.fx,w.fy,p.x,p.y,r.z
0,1.2,1.9,0,0,0.1,0.4,0
1,1.2,1.9,10,0,0.1,0.4,0
2,1.2,1.9,0,20,0.1,0.4,0
"""
BESIDE = {
    "robot": "five_bar",
    "position_noise": 2e-6,
    "tolerances": {"encoder_offset": 1e-4, "mass": 0.1},
    "notes": "x",
}
PATH = """time,x,y,w.fx,w.fy
0,0.0,0.40,0,0
1,0.01,0.41,30,0
2,0.02,0.40,0,-20
"""
#: Half a second of a motion, with efforts.
EFFORTS = "time,q.left_motor,q.right_motor,qd.left_motor,tau.left_motor,tau.right_motor\n" + "".join(
    f"{t:.2f},{np.sin(9 * t) / 5:.6f},{np.cos(7 * t) / 5:.6f},{9 * np.cos(9 * t) / 5:.6f},{t % 0.3:.2f},{t % 0.2:.2f}\n"
    for t in np.arange(60) / 100
)
MODEL = {"format": "prup_pin corrected model", "version": 1, "robot": str(ROOT / "examples" / "five_bar.urdf"),
         "effects": [], "noise": {"position_noise": 2e-6}, "notes": ""}  # fmt: skip
PLAN = {"robot": "five_bar", "poses": [{"at": {"x": 0.1, "y": 0.4}},
                                       {"random": {"count": 2, "bounds": {"x": [0.05, 0.1], "y": [0.38, 0.42]}}}],
        "loads": [{"cycle": [0, 1, 0], "wrench": {"fx": 60}},
                  {"random_directions": 2, "force": 60, "moment": 1, "poses": [0]}],
        "temperature": {"from": 20, "to": 35}, "noise": {"position_noise": 2e-6}, "seed": 1}  # fmt: skip
#: A map, key by key.
MAP = (
    "robot: ur5\n",
    "time: {from: t, unit: s}\n",
    """columns:
  q.shoulder_pan_joint: {from: q1, unit: rad, sign: -1, offset: 0.02, unwrap: true}
  tau.elbow_joint: {from: tau3, unit: A, scale: 10.4}
  qd.elbow_joint: {from: tau4, unit: rpm}
  q.m5: {from: q5}
  q.m6: {from: q6, unit: deg}
  p.tool0.x: {from: q2, unit: mm}
""",
    "motors:\n  - {names: [m5, m6], joints: [wrist_2_joint, wrist_3_joint], matrix: [[0.01, 0], [-0.01, 0.01]]}\n",
    "rotations:\n  r.tool0: {from: [q3, q4, q5, q6], as: quaternion_xyzw}\n",
    "resample: {rate: 250}\n",
    "at_rest: true\n",
    "noise: {effort_noise: 0.1}\n",
    "tolerances: {effort_gain: 1, mass: 0.1}\n",
    "notes: third day\n",
)
#: A map that is small, and a value in it that is not.
BOMB = "a: &a [1, 1]\n" + "".join(
    f"{c}: &{c} [*{p}, *{p}, *{p}]\n" for p, c in zip("abcdefghij", "bcdefghijk", strict=True)
)
COMMANDS = (
    "stiffness 3prup --at z=0.4,theta=0.1,phi=0 --wrench fx=300", "stiffness ur5 --actuators 0,-1,1,0,1,0 --json -",
    "stiffness 3prup --actuators 0.35,0.51,0.36 --set leg1/linear_rod.diameter=0.02", "kinds", "laws play", "robots",
    "stiffness ur5 --joint-stiffness 1e4 --home 0,-1,1,0,1,0", "info ur5", "info 3prup --lock leg1_slide",
    "sweep 3prup --over z=0.38..0.4:3 --over theta=0 --over phi=0", "examples", "info ur5 --frame tool0",
    "sweep 3prup --over z=0.38..0.4 --over theta=0 --over phi=0 --draws 3 --force 300", "sweep --quantities help",
    "stiffness 3prup --variant as_published --tool tool0", "import x.csv --map m.yaml", "--version",
)  # fmt: skip
WORDS = (
    *("stiffness", "info", "check", "kinds", "laws", "robots", "3prup", "ur5", "nope", "--at", "--wrench", "--tool"),
    *("--joint-stiffness", "--set", "--lock", "--frame", "--actuators", "--home", "--variant", "--actuated", "-"),
    *("z=0.4", "theta=10deg", "elbow_joint=40deg", "fx=300", "mz=1e300", "1e4", "1e-308", "a=b", "=", ",", "", "\x00"),
    *("~x/y", "leg1_branch", "leg1/linear_rod.diameter=0", "tool0", "x" * 300, "0.35,0.51,0.36", "as_published", "--"),
    *("-1", "sweep", "--over", "theta=-1..1:3", "z=0.4..0.3:5", "z=0.4:9999999999", "--draws", "import", "simulate"),
)


class TooLong(BaseException):
    """An input that takes longer than it may; nothing catches it but the fuzz."""


# -- damage ------------------------------------------------------------------------------------------------------------


def bent(draw: random.Random, content: bytes) -> bytes:
    """Return bytes of which some are others, missing, or there twice."""
    out = bytearray(content)
    for _ in range(draw.choice((1, 1, 1, 2, 4, 16))):
        if not out:
            break
        at, size = draw.randrange(len(out)), draw.choice((1, 2, 8, 64, 500))
        how = draw.randrange(7)
        if how < 2:
            out[at] ^= 1 << draw.randrange(8)
        elif how == 2:
            out[at] = draw.choice((0, 255, 127, draw.randrange(256)))
        elif how == 3:
            number = draw.choice((0, 1, 2**31 - 1, 2**32 - 1, 2**40, 2**63 - 1, 2**64 - 1))
            kind = draw.choice(("<I", "<Q", ">I", ">Q"))
            packed = struct.pack(kind, number & (2**32 - 1 if "I" in kind else 2**64 - 1))
            out[at : at + len(packed)] = packed
        elif how == 4:
            del out[at : at + size]
        elif how == 5:
            out[at:at] = out[at : at + size]
        else:
            out = out[: at + 1] if draw.random() < 0.3 else out
    return bytes(out)


def reworded(draw: random.Random, text: str, pattern: str = r"([\w.+-]+|\"[^\"]*\")") -> str:
    """Return a text in which some of the words and numbers are something odd."""
    for _ in range(draw.choice((0, 1, 1, 2, 3))):
        places = list(re.finditer(pattern, text))
        if places:
            start, end = draw.choice(places).span(1)
            other = draw.choice(places).group() * draw.choice((1, 2, 50))
            text = text[:start] + draw.choice((*ODD, other)) + text[end:]
    return text


def damaged(draw: random.Random, text: str) -> bytes:
    """Return a text with odd words in it, seldom with odd bytes too."""
    content = reworded(draw, text).encode("utf-8", "surrogatepass")
    return bent(draw, content) if draw.random() < 0.2 else content


# -- logs --------------------------------------------------------------------------------------------------------------

T = logs.T[:60]
Q, QD, TAU = logs.motion(T)
TABLE = {"t": T, **logs.numbered("q{}", Q), **logs.numbered("tau{}", TAU)}


def log_files(folder: Path, secret: Path) -> dict[str, Path]:
    """Write a log of each format that is read, and some that point elsewhere, declare too much or hold themselves."""
    made: dict[str, Path] = {}

    def new(name: str) -> Path:
        made[name] = folder / name
        return made[name]

    for name, how in (
        ("a.csv", {}),
        ("b.tsv", {"separator": "\t"}),
        ("c.txt", {"separator": " "}),
        ("d.csv", {"separator": ";", "decimal": ",", "below": [";".join(["s"] + 12 * ["deg"])]}),
    ):
        logs.csv(new(name), TABLE, **how)  # fmt: skip
    stamps = pyarrow.array((1.7e18 + T * 1e9).astype("int64"), pyarrow.timestamp("ns"))
    table = pyarrow.table({"stamp": stamps, "q": list(Q), "tau1": TAU[:, 0], "state": ["ok"] * len(Q)})
    parquet.write_table(table, new("a.parquet"), write_page_checksum=True)
    parquet.write_table(table, new("b.parquet"), compression="zstd", use_dictionary=False)
    data = {"data": {"t": T, "q": Q, "tau": TAU.T, "name": "ur5", "cell": np.array([1, "a"], object)}, "fs": 250.0}
    scipy.io.savemat(new("a.mat"), data)
    scipy.io.savemat(new("b.mat"), data, do_compression=True)
    scipy.io.savemat(new("c.mat"), {"t": T, "q": Q}, format="4")
    np.savez(new("a.npz"), t=T, q=Q)
    np.savez_compressed(new("b.npz"), t=T, q=Q, o=np.array([{}], object))
    np.save(new("a.npy"), np.column_stack([T, Q]))
    with zipfile.ZipFile(new("bomb.npz"), "w", zipfile.ZIP_DEFLATED) as archive, archive.open("t.npy", "w") as member:
        np.lib.format.write_array_header_1_0(member, {"descr": "<f8", "fortran_order": False, "shape": (2**22,)})
        member.write(bytes(8 * 2**22))
    for name in ("a.h5", "b.mat7.mat"):
        with h5py.File(new(name), "w") as file:
            group = file.create_group("data")
            group.create_dataset("t", data=T[:, None], fletcher32=True).attrs["MATLAB_class"] = np.bytes_("double")
            group.create_dataset("q", data=Q, compression="gzip")
            group["self"], group["soft"] = file["/"], h5py.SoftLink("/data/t")
            file.create_dataset("huge", (1000,), float, maxshape=(None,), chunks=(100,))
    with h5py.File(new("elsewhere.h5"), "w") as file:
        file["t"] = T
        file["linked"] = h5py.ExternalLink(str(secret / "secret.h5"), "/x")
    with h5py.File(new("external.h5"), "w") as file:
        file["t"] = T
        file.create_dataset("raw", (64,), "u1", external=[(str(secret / "secret.bin"), 0, 64)])
    with h5py.File(new("virtual.h5"), "w") as file:
        layout = h5py.VirtualLayout((60,), float)
        layout[:] = h5py.VirtualSource(str(secret / "secret.h5"), "/x", (60,))
        file.create_virtual_dataset("v", layout)
    for kind in ("ros2msg", "json"):
        logs.mcap_file(new(f"{kind}.mcap"), T, Q, QD, TAU, kind)
    for name, storage in (("sqlite", "sqlite3"), ("chunks", "mcap")):
        logs.ros2_bag(new(name), T, Q, QD, TAU, storage)
    for how in (None, "bz2", "lz4"):
        logs.ros1_bag(new(f"{how}.bag"), T, Q, QD, TAU, how)
    return made


def messages_of(draw: random.Random, path: Path) -> None:
    """Write an MCAP file whose checksums are right and whose messages or types are not."""
    from mcap.writer import CompressionType, Writer

    keys = {f"k{draw.randrange(10**6)}_{j}": j for j in range(draw.choice((0, 0, 2000)))}
    plain = {
        "name": list(logs.JOINTS),
        "position": Q[0].tolist(),
        "header": {"stamp": {"sec": 5, "nanosec": 7}},
        **keys,
    }
    with path.open("wb") as file:
        writer = Writer(file, compression=draw.choice(list(CompressionType)))
        writer.start()
        if draw.random() < 0.5:
            channel = writer.register_channel("/a", "json", writer.register_schema("J", "jsonschema", b"{}"))
            bodies = [damaged(draw, json.dumps(plain)) if draw.random() < 0.3 else json.dumps(plain).encode()
                      for _ in range(20)]  # fmt: skip
            if draw.random() < 0.1:
                bodies.append(b"[" * 10**5)
            if draw.random() < 0.1:
                bodies.append(b'{"a":' * 500 + b"1" + b"}" * 500)
        else:
            text = damaged(draw, logs.JOINT_STATE)
            name = draw.choice(("sensor_msgs/msg/JointState", "a/b", "a/msg/B(object):\n import os", "", "/"))
            channel = writer.register_channel("/a", "cdr", writer.register_schema(name, "ros2msg", text))
            bodies = [bent(draw, b"\0\1\0\0" + bytes(200)) for _ in range(20)]
        for k, body in enumerate(bodies):
            stamp = draw.choice((k * 10**7, 2**64 - 1)) if draw.random() < 0.05 else k * 10**7
            writer.add_message(channel, log_time=stamp, data=body, publish_time=0)
        writer.finish()


# -- what is tried -----------------------------------------------------------------------------------------------------


def invoked(arguments: list[str]) -> None:
    """Run a command line; raise what is neither an answer nor an error of ours."""
    done = CliRunner(env={"COLUMNS": "100"}).invoke(app, arguments)
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert done.exit_code in (0, 2), f"exit code {done.exit_code}: {arguments}"
    told = done.stderr or (done.stdout if arguments[0] == "check" else "")  # its page says that home does not close
    assert done.exit_code == 0 or told.strip(), f"an error without a word: {arguments}"
    if done.exit_code == 0 and "--json" in arguments and done.stdout.startswith("{"):
        json.loads(done.stdout, parse_constant=lambda word: (_ for _ in ()).throw(AssertionError(f"{word} in JSON")))
    if done.exit_code:
        raise PrupPinError(told)


class Trials:
    """All kinds of input: each takes a source of chance, damages a file, and gives it to the package."""

    def __init__(self, folder: Path, secret: Path):
        self.folder, self.secret = folder, secret
        self.bases = log_files(folder, secret)
        self.ur5 = prup_pin.load("ur5").mechanism
        self.five_bar = prup_pin.load(ROOT / "examples" / "five_bar.urdf")
        stood = {name: np.where(T[30] <= T, values[30], values) for name, values in TABLE.items() if name != "t"}
        self.table = read_log(logs.csv(folder / "rests.csv", {"t": 30 * T, **stood}))
        (folder / "five_bar").symlink_to(ROOT / "examples" / "five_bar.urdf")

    def file(self, name: str, content: bytes) -> Path:
        path = self.folder / "now" / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(content)
        return path

    def robots(self, draw: random.Random) -> None:
        source = draw.choice(ROBOTS)
        text = source.read_text(encoding="utf-8")
        values = draw.random() < 0.8
        content = reworded(draw, text, '="([^"]*)"').encode("utf-8", "replace") if values else damaged(draw, text)
        if draw.random() < 0.05:
            system = f'<!DOCTYPE robot [<!ENTITY e SYSTEM "file://{self.secret}/secret.bin">]>'.encode()
            content = system + content.partition(b"?>")[2].replace(b"</", b"&e;</", 1)
        path = self.file(f"robot{source.suffix}", content)
        invoked([draw.choice(("check", "info")), str(path)])
        invoked(["stiffness", str(path), "--json", "-"])

    def recordings(self, draw: random.Random) -> None:
        head = RECORDING.splitlines(True)
        text = RECORDING + "".join(f"{k}{draw.choice(head[1:])[1:]}" for k in range(3, draw.choice((3, 3, 60))))
        path = self.file("bench.csv", damaged(draw, text))
        beside = json.dumps(BESIDE)
        self.file("bench.json", damaged(draw, beside) if draw.random() < 0.4 else beside.encode())
        write_recording(read_recording(path), path.with_name("again.csv"))
        if draw.random() < 0.1:
            robot = str(ROOT / "examples" / "five_bar.urdf")
            invoked(["simulate", str(path), "--robot", robot, "--out", str(path.with_name("out.csv"))])

    def logs(self, draw: random.Random) -> None:
        base = draw.choice(list(self.bases.values()))
        if draw.random() < 0.15:
            path = self.file("log.mcap", b"")
            messages_of(draw, path)
        elif base.is_dir():
            spoilt = draw.choice(sorted(base.iterdir()))
            for part in base.iterdir():
                bend = bent if part.suffix != ".yaml" else lambda d, c: damaged(d, c.decode())
                self.file(part.name, bend(draw, part.read_bytes()) if part == spoilt else part.read_bytes())
            path = self.folder / "now"
        elif base.suffix == ".npz" and draw.random() < 0.7:  # within its checksums
            path = self.file("log.npz", b"")
            with zipfile.ZipFile(base) as old, zipfile.ZipFile(path, "w") as new:
                for name in old.namelist():
                    new.writestr(draw.choice((name, name, "../x.npy", ".npy", "\u00b5/t")), bent(draw, old.read(name)))
        else:
            content = base.read_bytes()
            plain = base.suffix in (".csv", ".tsv", ".txt") and draw.random() < 0.7
            whole = "elsewhere" in base.stem or base.stem in ("external", "virtual")
            content = damaged(draw, content.decode()) if plain else content if whole else bent(draw, content)
            path = self.file(f"log{base.suffix}", content)
        log, mechanism = read_log(path), draw.choice((self.ur5, self.ur5, None))
        path = self.file("log.map.yaml", guess(log, mechanism).text.encode())
        write_recording(convert(log, read_map(path, log, mechanism), mechanism).recording, path.with_name("out.csv"))

    def sidecars(self, draw: random.Random) -> None:
        source = draw.choice(SIDECARS)
        for path in (source, *source.parent.glob("*.urdf")):
            content = path.read_bytes()
            self.file(path.name, damaged(draw, content.decode()) if path == source else content)
        (robot,) = (self.folder / "now").glob("*.urdf")
        invoked([draw.choice(("check", "info")), str(robot)])

    def paths(self, draw: random.Random) -> None:
        path = self.file("path.csv", damaged(draw, PATH))
        robot = str(ROOT / "examples" / "five_bar.urdf")
        invoked(["compensate", str(path), "--robot", robot, "--out", str(path.with_name("out.csv"))])

    def efforts(self, draw: random.Random) -> None:
        path = self.file("motion.csv", damaged(draw, EFFORTS))
        beside = json.dumps({"robot": "five_bar", "effort_noise": 0.1})
        self.file("motion.json", damaged(draw, beside) if draw.random() < 0.3 else beside.encode())
        robot = str(ROOT / "examples" / "five_bar.urdf")
        invoked(draw.choice((["check", str(path), "--robot", robot], ["simulate", str(path), "--robot", robot, "--out",
                                                                     str(path.with_name("out.csv"))])))  # fmt: skip

    def maps(self, draw: random.Random) -> None:
        keys = [*MAP[:4], *(key for key in MAP[4:] if draw.random() < 0.5)]
        text = "".join([BOMB] * (draw.random() < 0.02) + keys)
        text = text.replace("[[0.01, 0]", "[" * 10**4) if draw.random() < 0.02 else text
        path = self.file("map.yaml", damaged(draw, text))
        done = convert(self.table, read_map(path, self.table, self.ur5), self.ur5)
        write_recording(done.recording, path.with_name("out.csv"))

    def plans(self, draw: random.Random) -> None:
        plan = read_plan(self.file("plan.json", damaged(draw, json.dumps(PLAN))))
        if plan.pose_count <= 20:
            plan.inputs(lambda at: self.five_bar.pose(**at).actuators)

    def models(self, draw: random.Random) -> None:
        self.file("bench.csv", RECORDING.encode())
        path = self.file("model.json", damaged(draw, json.dumps(MODEL)))
        read_model(path)
        if draw.random() < 0.2:
            bench, out = str(path.with_name("bench.csv")), str(path.with_name("out.csv"))
            invoked(["predict", str(path), bench, "--out", out])

    def tolerances(self, draw: random.Random) -> None:
        read_tolerances(self.file("tolerances.json", damaged(draw, json.dumps(BESIDE))))

    def command_lines(self, draw: random.Random) -> None:
        os.chdir(self.folder / "now") if (self.folder / "now").exists() else None
        words = draw.choice(COMMANDS).split()
        for _ in range(draw.choice((0, 1, 1, 2))):
            at = draw.randrange(len(words))
            words[at : at + draw.choice((0, 1, 1, 1))] = [draw.choice((*WORDS, *ODD, reworded(draw, words[at])))]
        invoked([word for word in words if word != "view"])


KINDS = ("robots", "recordings", "logs", "maps", "plans", "models", "tolerances", "command_lines", "sidecars", "paths",
         "efforts")  # fmt: skip
#: How often each is tried.
WEIGHTS = (1, 2, 6, 3, 2, 1, 0.5, 1, 0.5, 1, 1)


# -- the watch ---------------------------------------------------------------------------------------------------------


class Watch:
    """A folder that nobody names as an input: whoever opens a file in it, in C or Python, is seen (inotify)."""

    def __init__(self, folder: Path):
        libc = ctypes.CDLL(None, use_errno=True)
        self._events = libc.inotify_init1(os.O_NONBLOCK)
        assert libc.inotify_add_watch(self._events, os.fsencode(folder), 0x20 | 0x1) >= 0  # IN_OPEN, IN_ACCESS

    def opened(self) -> bool:
        try:
            return bool(os.read(self._events, 65536))
        except BlockingIOError:
            return False


def tried(trials: Trials, watch: Watch, kind: str, number: int, seed: int) -> tuple[str, str, float]:
    """Return the outcome of one input, what is to be known of it, and how long it took [s]."""

    def too_long(signum: int, frame: object) -> None:
        raise TooLong

    signal.signal(signal.SIGPROF, too_long)
    for path in sorted((trials.folder / "now").rglob("*")) if (trials.folder / "now").exists() else ():
        path.unlink()
    outcome, told = "answered", ""
    faulthandler.dump_traceback_later(6 * LONGEST, exit=True)
    signal.setitimer(signal.ITIMER_PROF, LONGEST)  # of computing, however busy the machine is
    begun = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.simplefilter("error", RuntimeWarning)
            getattr(trials, kind)(random.Random(f"{seed} {number}"))
    except PrupPinError as error:
        outcome, told = "refused", str(error)
        if not told.strip() or "Traceback" in told:
            outcome = "an error without words"
    except TooLong:
        outcome, told = f"longer than {LONGEST} s", traceback.format_exc()
    except Exception as error:
        outcome, told = type(error).__name__, traceback.format_exc()
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        faulthandler.cancel_dump_traceback_later()
    return "read elsewhere" if watch.opened() else outcome, told, time.process_time() - begun


def worked(numbers: list[int], kinds: list[str], seed: int, folder: str, pipe) -> None:
    """Try inputs by their numbers, one after the other, and send each outcome."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    faulthandler.enable()
    secret = Path(folder) / "secret"
    secret.mkdir(parents=True)
    (secret / "secret.bin").write_bytes(bytes(range(64)) * 8)
    with h5py.File(secret / "secret.h5", "w") as file:
        file["x"] = T
    trials = Trials(Path(folder), secret)
    watch = Watch(secret)
    for number, kind in zip(numbers, kinds, strict=True):
        pipe.send(("begun", number))
        pipe.send((number, kind, *tried(trials, watch, kind, number, seed)))
    pipe.send(None)


def outcomes(numbers: list[int], kinds: list[str], seed: int, ends: float) -> Iterator[tuple]:
    """Yield (number, kind, outcome, words, seconds) of inputs, by one process; where it dies, by another."""
    spawn = multiprocessing.get_context("spawn")
    while numbers and time.monotonic() < ends:
        here, there = spawn.Pipe(duplex=False)
        with tempfile.TemporaryDirectory() as folder:
            process = spawn.Process(target=worked, args=(numbers, kinds, seed, f"{folder}/fuzz", there))
            process.start()
            there.close()
            begun = None
            try:
                while time.monotonic() < ends and (said := here.recv()) is not None:
                    if said[0] == "begun":
                        begun = numbers.index(said[1])
                    else:
                        yield said
                        begun = None
                numbers = []
            except EOFError:
                process.join()
                if begun is None:
                    raise SystemExit(f"fuzz: could not begin, exit code {process.exitcode}") from None
                yield numbers[begun], kinds[begun], "died", f"exit code {process.exitcode}", 0.0
                numbers, kinds = numbers[begun + 1 :], kinds[begun + 1 :]
            finally:
                process.terminate()
                process.join()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=None)
    parser.add_argument("--count", type=int, default=None)
    parser.add_argument("--seed", type=int, default=int(datetime.now(timezone.utc).strftime("%Y%m%d")))
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--only", type=int, default=None)
    given = parser.parse_args()
    chosen = [kind for kind in KINDS if kind in given.kinds.split(",")]
    weights = [WEIGHTS[KINDS.index(kind)] for kind in chosen]
    count = given.count or (given.only or 0) + 1_000_000
    kinds = random.Random(given.seed).choices(chosen, weights, k=count)
    numbers = list(range(count)) if given.only is None else [given.only]
    kinds = [kinds[number] for number in numbers]
    seconds = given.seconds or (60.0 if given.count is None and given.only is None else float("inf"))
    table: dict[str, Counter[str]] = {kind: Counter() for kind in chosen}
    wrong: dict[str, int] = {}
    longest = 0.0, ""
    for number, kind, outcome, words, took in outcomes(numbers, kinds, given.seed, time.monotonic() + seconds):
        table[kind][outcome] += 1
        longest = max(longest, (took, f"{kind}, --only {number}"))
        if given.only is not None:
            print(f"{kind} {number}: {outcome}\n{words}")
        if outcome not in ("answered", "refused"):
            where = [line for line in words.splitlines() if line.strip()]
            place = next((line.strip() for line in reversed(where) if "/prup_pin/" in line), "")
            line = f"{kind}: {outcome}: {where[-1].strip()[:200] if where else ''} {place[-90:]}"
            wrong[line] = wrong.get(line, 0) + 1
            if wrong[line] == 1:
                print(f"fuzz: --seed {given.seed} --only {number}  {line}", flush=True)
    for kind, found in table.items():
        ends = ", ".join(f"{n} {what}" for what, n in found.most_common())
        print(f"fuzz: {kind}: {found.total()} inputs: {ends}")
    print(f"fuzz: the longest took {longest[0]:.1f} s ({longest[1]})")
    print(f"fuzz: {sum(map(Counter.total, table.values()))} inputs by seed {given.seed}; {sum(wrong.values())} wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
