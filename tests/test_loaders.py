"""Every loader against damaged and impossible files: refused by name, or unchanged; sizes cost nothing before that."""

import io
import tracemalloc
import zipfile

import numpy as np
import pytest

from sgimd_torch.demonstrations import load_demonstrations, save_demonstrations
from sgimd_torch.evaluation import Benchmark, load_benchmark, save_benchmark
from sgimd_torch.files import UNPACKED, read_npz, write_npz
from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Demonstration

NAMES = ("numbers",)


def read(path):
    return read_npz(path, "file", "a test", 1, NAMES)[0]


def zipped(path, members, method=zipfile.ZIP_STORED):
    with zipfile.ZipFile(path, "w", method) as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)


def npy(array):
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def headed(text, data=bytes(48)):
    """An npy file whose header is this text."""
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + data


@pytest.mark.parametrize(
    "member",
    [
        headed(b"{'descr': (\n"),  # tokenize.TokenError of numpy's reader
        headed(b"(" * 9000),  # MemoryError or RecursionError of Python's parser
        headed(b"{'descr': '<f8', 'fortran_order': False, 'shape': (3, 99999999999999999999), }\n"),  # OverflowError
        headed(b"{'descr': '<f8', 'fortran_order': False, 'shape': (0, 99999999999999999999), }\n", b""),
        headed(b"{'descr': '<f8', 'fortran_order': False, 'shape': (2, 100000000000), }\n"),  # 1.6 TB
        headed(b"{'descr': '<f8', 'fortran_order': False, 'shape': (-2, -3), }\n"),
        headed(b"{'descr': '<f8', 'fortran_order': False, 'shape': 'a', }\n"),  # TypeError
        headed(b"{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (6,), }\n"),
        headed(b"{'descr': '|O', 'fortran_order': False, 'shape': (6,), }\n"),
        headed(b"{'descr': '<U999999999', 'fortran_order': False, 'shape': (), }\n"),
        headed(b"{'descr': '<f8', 'fortran_order': False, 'shape': (5,), }\n"),  # fewer numbers than there are
        headed(b"{'descr': '<f8', 'fortran_order': False, 'shape': (7,), }\n"),
        b"",
    ],
)
def test_an_array_with_an_impossible_header_is_refused_before_memory_is_taken(tmp_path, member):
    path = tmp_path / "file.npz"
    zipped(path, {"version": npy(np.array(1)), "numbers": member})
    with pytest.raises(ValueError, match=r"file\.npz is no file: it is damaged"):
        read(path)


@pytest.mark.parametrize(("order", "kind"), [("C", "<f8"), ("F", "<f8"), ("C", ">f4"), ("C", "<i2"), ("C", "|b1")])
def test_what_numpy_writes_is_read_as_numpy_reads_it(tmp_path, order, kind):
    path = tmp_path / "file.npz"
    for shape in ((), (3,), (2, 3), (0, 4), (2, 3, 4)):
        values = np.asarray(np.arange(np.prod(shape, dtype=int)).reshape(shape), kind, order=order)
        np.savez_compressed(path, version=1, numbers=values)
        found = read(path)
        assert found.dtype == kind
        np.testing.assert_array_equal(found, values)
        assert not found.flags.writeable


def test_a_shape_made_smaller_by_a_flipped_bit_is_noticed(tmp_path):
    path = tmp_path / "goals.npz"
    save_benchmark(path, Benchmark("PlanarArm", np.ones((33, 2)), 0.1))
    content = path.read_bytes()
    path.write_bytes(content.replace(b"(33, 2)", b"(32, 2)"))  # numpy stops reading before it compares the checksum
    with pytest.raises(ValueError, match="damaged"):
        load_benchmark(path)


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_what_is_packed_otherwise_than_numpy_packs_is_refused(tmp_path, method):
    path = tmp_path / "file.npz"
    zipped(path, {"version": npy(np.array(1)), "numbers": npy(np.zeros(9))}, method)
    with pytest.raises(ValueError, match="numpy does not write"):
        read(path)


def peak_of(action):
    """The most memory (bytes) that an action took at once."""
    tracemalloc.start()
    try:
        action()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_a_small_file_that_unpacks_to_much_is_refused_before_it_is_unpacked(tmp_path):
    path = tmp_path / "file.npz"
    np.savez_compressed(path, version=1, numbers=np.zeros(UNPACKED // 8))
    size = path.stat().st_size
    assert size < UNPACKED // 500

    def refused():
        with pytest.raises(ValueError, match=rf"its {size} bytes unpack to {UNPACKED + 264}, at most {UNPACKED} are"):
            read(path)

    assert peak_of(refused) < 2**20


def test_a_file_that_unpacks_to_more_than_its_directory_says_takes_no_more_than_that(tmp_path):
    path, numbers = tmp_path / "file.npz", npy(np.zeros(2**22))
    zipped(path, {"version": npy(np.array(1)), "numbers": numbers}, zipfile.ZIP_DEFLATED)
    size = len(numbers).to_bytes(4, "little")
    assert size in path.read_bytes()
    path.write_bytes(path.read_bytes().replace(size, (200).to_bytes(4, "little")))

    def refused():
        with pytest.raises(ValueError, match="damaged"):
            read(path)

    assert peak_of(refused) < 2**20


def test_two_arrays_of_one_name_are_refused(tmp_path):
    path = tmp_path / "file.npz"
    zipped(path, {"version": npy(np.array(1)), "numbers": npy(np.zeros(2))})
    with pytest.warns(UserWarning, match="Duplicate"), zipfile.ZipFile(path, "a") as archive:
        archive.writestr("numbers.npy", npy(np.ones(2)))
    with pytest.raises(ValueError, match="same name"):
        read(path)


def test_large_recordings_that_would_pack_too_well_are_saved_so_that_they_are_read(tmp_path):
    path, n = tmp_path / "still.npz", UNPACKED // 8 // 4
    save_demonstrations(path, [Demonstration(np.zeros(0), np.arange(float(n)), np.zeros((n, 4)), np.zeros(2))])
    assert load_demonstrations(path)[0].trajectory.shape == (n, 4)


def recordings(**changes):
    """The arrays of two recordings of 2 and 3 samples, as in their file."""
    arrays = {"lengths": np.array([2, 3]), "times": np.array([0, 0.1, 0, 0.1, 0.2]), "trajectories": np.zeros((5, 1))}
    return {"version": 1, **arrays, "outcomes": np.zeros((2, 2)), "contexts": np.zeros((2, 0)), **changes}


def test_lengths_whose_sum_overflows_are_refused(tmp_path):
    path = tmp_path / "long.npz"
    lengths, many = np.array([2**62, 2**62, 2**62, 2**62 + 5]), (np.zeros((4, 2)), np.zeros((4, 0)))
    assert lengths.sum() == 5
    write_npz(path, recordings(lengths=lengths, outcomes=many[0], contexts=many[1]))
    with pytest.raises(ValueError, match=r"long\.npz: lengths add up to 18446744073709551621 samples"):
        load_demonstrations(path)


def test_more_recordings_than_anybody_makes_are_refused(tmp_path):
    path, n = tmp_path / "many.npz", 100_001
    write_npz(path, recordings(lengths=np.full(n, 2), outcomes=np.zeros((n, 2)), contexts=np.zeros((n, 0))))
    with pytest.raises(ValueError, match=r"many\.npz holds 100001 demonstrations, at most 100000 are read"):
        load_demonstrations(path)


def test_recordings_of_another_precision_are_given_as_float64(tmp_path):
    path = tmp_path / "single.npz"
    write_npz(path, recordings(trajectories=np.ones((5, 1), dtype=np.float32), outcomes=np.ones((2, 2), dtype=">f8")))
    for recording in load_demonstrations(path):
        assert recording.trajectory.dtype == recording.outcome.dtype == np.float64


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"context_weight": "much"}, "must hold a number"),
        ({"context_weight": 1j}, "must hold a number"),
        ({"context_weight": np.nan}, "context_weight nan"),
        ({"thetas": np.zeros((3, 0))}, "dimensions"),
        ({"outcomes": np.zeros((3, 0))}, "dimensions"),
        ({name: np.zeros((0, 10**12)) for name in ("contexts", "thetas", "outcomes")}, "dimensions"),  # 500 TB of room
    ],
)
def test_a_memory_that_cannot_be_is_refused_by_the_name_of_its_file(tmp_path, changes, words):
    path = tmp_path / "memory.npz"
    tables = {"contexts": np.zeros((3, 0)), "thetas": np.zeros((3, 1)), "outcomes": np.zeros((3, 2))}
    write_npz(path, {"version": 1, "context_weight": 1.0, **tables, **changes})
    with pytest.raises(ValueError, match=words) as raised:
        Memory.load(path)
    assert str(path) in str(raised.value)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"environment": np.array("\ud800")}, "name of a class"),
        ({"environment": np.array("x" * 10**6 + " ")}, "name of a class"),
        ({"goals": np.zeros((10**12, 0))}, "n > 0"),
        ({"side": np.array("1" * 10**6)}, "side"),
    ],
)
def test_a_benchmark_that_cannot_be_is_refused_in_few_words(tmp_path, changes, words):
    path = tmp_path / "goals.npz"
    goals = {"environment": np.array("PlanarArm"), "goals": np.zeros((3, 2)), "side": np.array(0.1)}
    write_npz(path, {"version": 1, **goals, **changes})
    with pytest.raises(ValueError, match=words) as raised:
        load_benchmark(path)
    assert str(path) in str(raised.value)
    assert len(str(raised.value)) < 400
