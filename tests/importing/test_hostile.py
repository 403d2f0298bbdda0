"""Logs that are damaged, or made to harm: each ends in one sentence with the file and the place, or in its numbers."""

from __future__ import annotations

import json
import os
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pyarrow
import pytest
import scipy.io
from mcap.writer import CompressionType, Writer
from pyarrow import parquet

from prup_pin.errors import RecordingFileError
from prup_pin.imports import guess, read_log, read_map
from prup_pin.imports import log as log_module

from . import logs

T = logs.T[:200]
Q, QD, TAU = logs.motion(T)
SECRET = np.arange(100.0, 160.0)


def refused(path, *words):
    """Return what a log is refused with, which has some words in it and names the file."""
    with pytest.raises(RecordingFileError) as raised:
        read_log(path)
    text = str(raised.value)
    assert Path(path).name in text
    for word in words:
        assert word in text
    return text


def mcap_of(path, bodies, compression=CompressionType.NONE, crcs=True):
    with path.open("wb") as file:
        writer = Writer(file, compression=compression, enable_crcs=crcs)
        writer.start()
        channel = writer.register_channel("/a", "json", writer.register_schema("J", "jsonschema", b"{}"))
        for k, body in enumerate(bodies):
            data = body if isinstance(body, bytes) else json.dumps(body).encode()
            writer.add_message(channel, log_time=k * 10**7, data=data, publish_time=0)
        writer.finish()
    return path


# -- checksums ---------------------------------------------------------------------------------------------------------


def mcap_packed(compression):
    return lambda path: (mcap_of(path, [{"q": q} for q in Q.tolist()], compression), None)[1]


def npz(path):
    np.savez(path, t=T, q=Q)
    with zipfile.ZipFile(path) as archive:
        return 0, archive.start_dir


def npz_packed(path):
    np.savez_compressed(path, t=T, q=Q)
    with zipfile.ZipFile(path) as archive:
        return 0, archive.start_dir


def parquet_pages(path):
    table = pyarrow.table({"t": T, **logs.numbered("q{}", Q)})
    parquet.write_table(table, path, write_page_checksum=True, compression="none")
    return 4, path.stat().st_size - 8 - int.from_bytes(path.read_bytes()[-8:-4], "little")


def hdf_chunks(path):
    with h5py.File(path, "w") as file:
        file["t"] = T
        file.create_dataset("q", data=Q, chunks=Q.shape, fletcher32=True)
    with h5py.File(path) as file:
        chunk = file["q"].id.get_chunk_info(0)
    return chunk.byte_offset, chunk.byte_offset + chunk.size


def matlab_packed(path):
    scipy.io.savemat(path, {"t": T, "q": Q}, do_compression=True)
    return 136, path.stat().st_size


def bag_packed(path):
    logs.ros1_bag(path, T, Q, QD, TAU, "bz2")
    content = path.read_bytes()
    return content.index(b"BZh"), content.rindex(b"conn=")


@pytest.mark.parametrize(
    ("ending", "make"),
    [
        pytest.param("mcap", mcap_packed(CompressionType.NONE), id="mcap"),
        pytest.param("mcap", mcap_packed(CompressionType.ZSTD), id="mcap-zstd"),
        pytest.param("mcap", mcap_packed(CompressionType.LZ4), id="mcap-lz4"),
        ("npz", npz),
        ("npz", npz_packed),
        ("parquet", parquet_pages),
        ("h5", hdf_chunks),
        ("mat", matlab_packed),
    ],
)
def test_no_flipped_bit_becomes_another_number(tmp_path, ending, make):
    path = tmp_path / f"log.{ending}"
    first, last = make(path) or (0, path.stat().st_size)
    whole = path.read_bytes()
    right = {name: stream.columns[name] for stream in read_log(path).streams for name in stream.columns}
    random = np.random.default_rng(1)
    seen = 0
    for at in random.integers(first, last, 60).tolist():
        bent = bytearray(whole)
        bent[at] ^= 1 << int(random.integers(8))
        path.write_bytes(bent)
        try:
            found = {name: stream.columns[name] for stream in read_log(path).streams for name in stream.columns}
        except RecordingFileError:
            seen += 1
        else:
            assert found.keys() == right.keys()
            assert all(np.array_equal(found[name], right[name]) for name in right)
    assert seen > 30


def test_a_database_that_is_damaged_is_refused(tmp_path):
    folder = logs.ros2_bag(tmp_path / "bag", logs.T, *logs.motion())
    (database,) = folder.glob("*.db3")
    content = bytearray(database.read_bytes())
    assert read_log(folder).streams
    content[4096:8192] = bytes(4096)
    database.write_bytes(content)
    text = " ".join(refused(folder).split())
    assert "cannot be read as a ROS bag" in text
    assert database.name in text


def test_a_path_that_a_database_takes_for_something_else(tmp_path):
    folder = logs.ros2_bag(tmp_path / "run", T, Q, QD, TAU).rename(tmp_path / "run#3")
    with pytest.raises(RecordingFileError, match=r"has \?, # or % in its path.*; rename it"):
        read_log(folder)


# -- other files -------------------------------------------------------------------------------------------------------


def linked(file, other):
    file["group/link"] = h5py.ExternalLink(other, "/x")


def external(file, other):
    file.create_dataset("group/raw", (len(SECRET),), float, external=[(other, 0, 8 * len(SECRET))])


def virtual(file, other):
    layout = h5py.VirtualLayout((len(SECRET),), float)
    layout[:] = h5py.VirtualSource(other, "/x", (len(SECRET),))
    file.create_virtual_dataset("group/virtual", layout)


def soft_to_linked(file, other):
    file["a"] = h5py.SoftLink("/z/x")
    file["z"] = h5py.ExternalLink(other, "/")


@pytest.mark.parametrize("kind", [linked, external, virtual, soft_to_linked])
def test_hdf5_that_is_kept_in_another_file_is_refused(tmp_path, kind):
    other = tmp_path / "secret.bin"
    if kind is external:
        other.write_bytes(SECRET.tobytes())
    else:
        with h5py.File(other, "w") as file:
            file["x"] = SECRET
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["t"] = T
        kind(file, str(other))
    refused(tmp_path / "log.h5", "is kept in another file", "secret.bin", "copy the numbers into this one")


def test_hdf5_of_one_file_is_read_once_though_it_holds_itself(tmp_path):
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["data/t"] = T
        file["data/again"] = file["data"]
        file["soft"] = h5py.SoftLink("/data/t")
        file["#refs#/a"] = T
    assert read_log(tmp_path / "log.h5").names == ("data.t",)
    with h5py.File(tmp_path / "log.h5", "a") as file:
        layout = h5py.VirtualLayout((len(T),), float)
        layout[:] = h5py.VirtualSource(".", "/data/t", (len(T),))
        file.create_virtual_dataset("twin", layout)
    refused(tmp_path / "log.h5", "'twin' is kept in another dataset (it is a virtual one), which is not read")


def test_hdf5_of_endless_groups_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("prup_pin.imports.matlab.MAX_COLUMNS", 50)
    with h5py.File(tmp_path / "log.h5", "w") as file:
        for k in range(101):
            file.create_group(f"g{k}")
    refused(tmp_path / "log.h5", "holds more than 100 groups and datasets")


# -- sizes -------------------------------------------------------------------------------------------------------------


def test_a_shape_beyond_memory_is_refused_before_anything_is_taken(tmp_path):
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["t"] = T
        file.create_dataset("huge", (10**12,), float, chunks=(1000,))
    refused(tmp_path / "log.h5", "'huge' declares 8000 GB of numbers", "more than the 2.15 GB")


def test_a_header_that_declares_more_than_there_is(tmp_path):
    with (tmp_path / "log.npy").open("wb") as file:
        np.lib.format.write_array_header_1_0(file, {"descr": "<f8", "fortran_order": False, "shape": (10**12, 6)})
        file.write(bytes(80))
    refused(tmp_path / "log.npy", "declares 48000000000000 bytes of numbers, and holds 80")


def bomb_npz(path):
    np.savez_compressed(path, t=np.zeros(10**6))


def bomb_mat(path):
    scipy.io.savemat(path, {"t": np.zeros(10**6)}, do_compression=True)


def bomb_mcap(path):
    mcap_of(path, [{"a": 1}, b'{"a": ' + b" " * 10**7 + b"1}"], CompressionType.ZSTD)


def bomb_parquet(path):
    parquet.write_table(pyarrow.table({"t": np.zeros(10**6)}), path)


def bomb_bag(path):
    n = 3000
    logs.ros1_bag(path, np.arange(n) * 0.01, *(np.zeros((n, 6)) for _ in range(3)), "bz2")


@pytest.mark.parametrize("make", [bomb_npz, bomb_mat, bomb_mcap, bomb_parquet, bomb_bag])
def test_a_small_file_that_unpacks_to_a_large_one_is_refused_by_what_it_declares(tmp_path, make, monkeypatch):
    path = tmp_path / f"log.{make.__name__.partition('_')[2]}"
    make(path)
    assert path.stat().st_size < 4 * 10**5
    assert read_log(path).streams
    monkeypatch.setattr(log_module, "MAX_NUMBERS", 4 * 10**5)
    refused(path, "declares", "more than the 0.0004 GB that are read; export a part of it")


def test_a_matlab_file_with_an_element_of_an_unknown_kind(tmp_path):
    scipy.io.savemat(tmp_path / "log.mat", {"t": T})
    content = bytearray((tmp_path / "log.mat").read_bytes())
    at = content.index(bytes((9, 0, 0, 0)) + (8 * len(T)).to_bytes(4, "little"), 128)
    content[at] = 25
    (tmp_path / "log.mat").write_bytes(content)
    refused(tmp_path / "log.mat", "cannot be read as a MATLAB file: the variable at byte 128 lacks its numbers")


def test_any_other_byte_in_a_matlab_file_is_numbers_or_a_sentence(tmp_path):
    data = {"s": {"t": T[:4], "cell": np.array([1, "a"], object), "z": T[:4] + 1j}, "b": T[:4] > 0.01}
    scipy.io.savemat(tmp_path / "log.mat", data)
    content = (tmp_path / "log.mat").read_bytes()
    refusals = 0
    for at in range(124, len(content)):
        for other in ((0, 255), (14, content[at] ^ 64))[at % 2]:
            (tmp_path / "log.mat").write_bytes(content[:at] + bytes((other,)) + content[at + 1 :])
            try:
                read_log(tmp_path / "log.mat")
            except RecordingFileError:
                refusals += 1
    assert refusals > 300


def test_what_unpacks_to_more_than_it_declares_is_refused(tmp_path):
    path = mcap_of(tmp_path / "log.mcap", [b'{"a": ' + b" " * 10**6 + b"1}"] * 3, CompressionType.ZSTD, crcs=False)
    content = bytearray(path.read_bytes())
    at = content.index(b"zstd") - 16  # before its checksum and the length of this word
    content[at : at + 8] = (1000).to_bytes(8, "little")
    path.write_bytes(content)
    refused(path, "does not unpack to the 1000 bytes that it declares")


def test_a_log_of_more_columns_than_anybody_records(tmp_path):
    (tmp_path / "log.csv").write_text(",".join(f"c{k}" for k in range(12_000)) + "\n" + ",".join(["1"] * 12_000) + "\n")
    refused(tmp_path / "log.csv", "holds 12000 columns", "expected at most 10000")


# -- messages ----------------------------------------------------------------------------------------------------------


def test_messages_of_many_names_are_read_and_those_of_ever_new_names_left_out(tmp_path):
    same = [{f"key{k}": row + k for k in range(2000)} for row in range(100)]
    (stream,) = read_log(mcap_of(tmp_path / "same.mcap", same)).streams
    assert len(stream.columns) == 2000
    assert stream.columns["/a.key7"].tolist() == [row + 7 for row in range(100)]
    new = [{f"key{row}_{k}": k for k in range(2000)} for row in range(100)]
    refused(mcap_of(tmp_path / "new.mcap", new), "/a (more than 10000 names of numbers)")


@pytest.mark.parametrize(
    ("body", "word"),
    [
        (b'{"a": 1', "message 2 of '/a'"),
        (b'{"a": "\xff"}', "message 2 of '/a'"),
        (b"[" * 100_000, "message 2 of '/a'"),
        (b'{"a": ' + b"9" * 5000 + b"}", "message 2 of '/a'"),
    ],
)
def test_a_message_that_cannot_be_read_is_told_by_its_number(tmp_path, body, word):
    refused(mcap_of(tmp_path / "log.mcap", [{"a": 1}, body]), "cannot be read as MCAP", word)


@pytest.mark.parametrize(
    "odd",
    [
        {"header": {"stamp": {"sec": "now"}}, "a": 1},
        {"header": {"stamp": {"sec": 1e300, "nanosec": None}}, "a": 1},
        {"header": {"stamp": [1]}, "a": 1},
        {"header": 5, "a": 1},
        {"a": 1, "b": 10**400},
        {"a": 1, "b": json.loads('{"a":' * 400 + "1" + "}" * 400)},
        {"name": {"x": 1}, "a": 1},
    ],
)
def test_odd_messages_beside_others_are_numbers_or_nothing(tmp_path, odd):
    (stream,) = read_log(mcap_of(tmp_path / "log.mcap", [{"a": 0}, odd, {"a": 2}])).streams
    assert stream.columns["/a.a"].tolist() == [0, 1, 2]
    assert stream.clock.tolist() == [0.0, 0.01, 0.02]


def test_a_recording_that_was_cut_off_says_where(tmp_path):
    path = mcap_of(tmp_path / "log.mcap", [{"a": 1}] * 100)
    path.write_bytes(path.read_bytes()[:-200])
    refused(path, "cannot be read as MCAP (after byte", "it ends too early. Is the file damaged or cut off?")
    logs.ros1_bag(tmp_path / "log.bag", T, Q, QD, TAU, "lz4")
    content = (tmp_path / "log.bag").read_bytes()
    (tmp_path / "log.bag").write_bytes(content[: len(content) // 2])
    refused(tmp_path / "log.bag", "cannot be read as a ROS bag")


@pytest.mark.parametrize("ending", ["mat", "h5", "npz", "parquet", "mcap", "bag"])
def test_the_first_half_of_a_file_is_refused(tmp_path, ending):
    path = tmp_path / f"log.{ending}"
    {
        "mat": lambda: scipy.io.savemat(path, {"t": T, "q": Q}),
        "h5": lambda: h5py.File(path, "w").create_dataset("q", data=Q).file.close(),
        "npz": lambda: np.savez(path, t=T, q=Q),
        "parquet": lambda: parquet.write_table(pyarrow.table({"t": T}), path),
        "mcap": lambda: logs.mcap_file(path, T, Q, QD, TAU),
        "bag": lambda: logs.ros1_bag(path, T, Q, QD, TAU, None),
    }[ending]()
    assert read_log(path).streams
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    refused(path, "cannot be read as")


def test_numbers_that_stand_for_none_are_none(tmp_path):
    np.savez(tmp_path / "log.npz", t=T, q=np.where(T > 0.1, [1.7e308], np.inf))
    (stream,) = read_log(tmp_path / "log.npz").streams
    assert np.isnan(stream.columns["q"]).all()
    assert np.array_equal(stream.columns["t"], T)


def test_a_name_writes_no_line_into_the_map_and_nothing_but_text_onto_a_terminal(tmp_path):
    with h5py.File(tmp_path / "log.h5", "w") as file:
        for name, values in {
            "t": T,
            "q1": Q[:, 0],
            "x\nrobot: evil": T,
            "x\x1b[2J": T,
            "x\x1b[2K": T,
            "n" * 2000: T,
        }.items():
            file[f"run\n\x07/{name}"] = values
        file["text\nnotes: evil"] = "a"
    log = read_log(tmp_path / "log.h5")
    assert len(log.names) == 6
    assert all(name.isprintable() for name in (*log.names, *log.left_out, log.streams[0].name))
    text = guess(log).text
    assert not any(line.startswith(("robot:", "notes:")) for line in text.splitlines())
    (tmp_path / "map.yaml").write_text(text)
    assert read_map(tmp_path / "map.yaml", log).columns["q.joint1"].source.endswith("q1")


def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "log.mcap")
    refused(tmp_path / "log.mcap", "is a pipe or a device; expected a file")
