"""The engine of web pages, shear-warp.wasm, beside the filter: the same bits. SHEARWARPMIP_PAGE_ENGINE is its path."""

import itertools
import os

import itk
import numpy as np
import pytest
from itk_shearwarpmip import mip, open_image
from numpy.testing import assert_array_equal

PATH = os.environ.get("SHEARWARPMIP_PAGE_ENGINE")
pytestmark = pytest.mark.skipif(not PATH, reason="SHEARWARPMIP_PAGE_ENGINE does not name the engine")

MODES = ["maximum", "minimum", "mean"]
SIZE, SPACING, ORIGIN = (90, 81), (0.9, 1.0), (-41.0, -38.5)


@pytest.fixture(scope="module")
def module():
    wasmtime = pytest.importorskip("wasmtime")
    engine = wasmtime.Engine()
    return wasmtime.Module.from_file(engine, PATH), engine


class Engine:
    """An instance of the engine."""

    def __init__(self, module):
        import wasmtime

        module, engine = module
        # a page gives it nothing to call
        assert not module.imports
        self.store = wasmtime.Store(engine)
        self.functions = wasmtime.Instance(self.store, module, []).exports(self.store)
        self.call("_initialize")

    def call(self, name, *arguments):
        """Calls a function with numbers and arrays, which are copied. Pointers are unsigned."""
        result = self.functions[name](self.store, *map(self.copy, arguments))
        return result & 0xFFFFFFFF if isinstance(result, int) else result

    def copy(self, argument):
        if not isinstance(argument, np.ndarray):
            return argument
        pointer = self.call("malloc", argument.nbytes)
        assert pointer
        self.functions["memory"].write(self.store, argument.tobytes(), pointer)
        return pointer

    def read(self, function, dtype, count):
        begin = self.call(function)
        memory = self.functions["memory"].read(self.store, begin, begin + count * np.dtype(dtype).itemsize)
        return np.frombuffer(memory, dtype)

    def check(self, error):
        text = bytes(self.read("GetError", np.uint8, 1000)).split(b"\0")[0].decode()
        assert bool(error) == bool(text)
        if error:
            raise ValueError(text)

    def set_volume(self, voxels, to_physical):
        self.dtype = voxels.dtype
        size = reversed(voxels.shape)
        self.check(self.call("SetVolume", 8 * voxels.itemsize, *size, np.array(to_physical, float), voxels))

    def project(
        self,
        view,
        *,
        size=SIZE,
        output_spacing=SPACING,
        output_origin=ORIGIN,
        mode=0,
        slab=(-np.inf, np.inf),
        exact=False,
        depth=False,
    ):
        grid = np.array([*size, *output_spacing, *output_origin], float)
        near, far = map(float, slab)
        self.check(self.call("Project", np.array(view, float)[:3], grid, mode, near, far, exact, depth))
        columns, rows = size
        pixels = self.read("GetPixels", self.dtype, columns * rows).reshape(rows, columns)
        return (pixels, self.read("GetDepths", np.float32, columns * rows).reshape(rows, columns)) if depth else pixels


@pytest.fixture
def engine(module):
    return Engine(module)


def turn(azimuth, elevation):
    (ca, sa), (ce, se) = ((np.cos(angle), np.sin(angle)) for angle in np.radians([azimuth, elevation]))
    return np.array([[ca, -sa * se, -sa * ce], [0, ce, -se], [sa, ca * se, ca * ce]])


def make_volume(rng, dtype, top):
    """An oblique, sheared, anisotropic volume, and its map of indices to physical space."""
    direction = turn(20, 10) @ [[1, 0.1, 0], [0, 1, 0], [0.05, 0, 1]]
    spacing, origin = np.array([0.7, 1.1, 1.9]), [-20, 5, 33]
    image = itk.image_from_array(rng.integers(1, top, (37, 45, 70), dtype, endpoint=True))
    image.SetSpacing(spacing)
    image.SetOrigin(origin)
    image.SetDirection(itk.matrix_from_array(direction))
    return image, np.c_[itk.array_from_matrix(image.GetDirection()) * spacing, origin]


def round_view(view):
    """What the filter makes of a matrix: differences of points."""
    matrix, offset = view[:3, :3], view[:3, 3:]
    return np.c_[((1024 * matrix + offset) - (-1024 * matrix + offset)) / 2048, offset]


def make_views(to_physical):
    """Views along each axis, along the patient's axes, and some onto the volume's own axes."""
    axes = to_physical[:, :3] / np.linalg.norm(to_physical[:, :3], axis=0)
    for matrix in (turn(30, 25), turn(85, 5), turn(5, -80), np.eye(3), axes, axes[:, [1, 2, 0]] * [1, -1, 1]):
        view = np.eye(4)
        view[:3] = np.c_[matrix, to_physical @ [35, 22, 18, 1]]
        yield view


@pytest.mark.parametrize("dtype, top", [(np.uint8, 255), (np.uint16, 65535), (np.uint16, 4000)])
@pytest.mark.parametrize("mode", MODES)
def test_pictures_have_the_bits_of_the_filter(engine, rng, mode, dtype, top):
    image, to_physical = make_volume(rng, dtype, top)
    engine.set_volume(np.asarray(image), to_physical)
    grid = {"size": SIZE, "output_spacing": SPACING, "output_origin": ORIGIN}
    flags = (False, True) if mode != "mean" else (False,)
    for view, slab, exact, depth in itertools.product(make_views(to_physical), (None, (-10, 8)), flags, flags):
        rule = {"exact": exact, "depth": depth, **({"slab": slab} if slab else {})}
        found = engine.project(round_view(view), mode=MODES.index(mode), **rule)
        expected = mip(image, view, mode=mode, background=0, **rule, **grid)
        for a, b in zip(found, expected, strict=True) if depth else [(found, expected)]:
            assert_array_equal(a, np.asarray(b))
        assert np.count_nonzero(a) > a.size // 10


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_views_have_the_bits_of_the_filter_where_tiles_are_skipped(engine, rng, dtype):
    voxels = rng.integers(1, 60, (150, 160, 170), dtype)
    voxels[70:80, 60:70, 50:60] = 200
    to_physical = np.c_[np.eye(3), [-85, -80, -75]]
    engine.set_volume(voxels, to_physical)
    image = open_image(voxels, origin=to_physical[:, 3])
    grid = {"size": (270, 260), "output_spacing": (1, 1), "output_origin": (-135, -130)}
    # the first view of a volume skips nothing
    for azimuth, elevation in 2 * [(10, 5), (95, 20), (15, 80)]:
        view = np.eye(4)
        view[:3, :3] = turn(azimuth, elevation)
        assert_array_equal(engine.project(view, **grid), np.asarray(mip(image, view, background=0, **grid)))
    assert engine.call("GetBytes") > voxels.nbytes


@pytest.mark.parametrize(
    "wrong, message",
    [
        ({"view": np.zeros((3, 4))}, "Transform must be invertible"),
        ({"view": np.full((3, 4), np.nan)}, "Transform must be finite"),
        ({"size": (0, 5)}, "whole number of columns and rows"),
        ({"size": (2.5, 5)}, "whole number of columns and rows"),
        ({"size": (1e6, 1e6)}, "at most 2\\^29 pixels"),
        ({"output_spacing": (1, -1)}, "OutputSpacing must be positive"),
        ({"output_origin": (0, np.inf)}, "OutputOrigin must be finite"),
        ({"mode": -1}, "Mode must be 0, 1 or 2, but it is -1"),
        ({"mode": 3}, "Mode must be 0, 1 or 2, but it is 3"),
        ({"slab": (2, 1)}, "SlabNear must be .* but they are 2 and 1"),
        ({"slab": (np.nan, 1)}, "SlabNear must be"),
        ({"mode": 2, "depth": True}, "ComputeDepth needs another Mode"),
        ({"mode": 2, "exact": True}, "Exact needs another Mode"),
    ],
)
def test_wrong_views_are_refused_in_words(engine, wrong, message):
    arguments = {"view": np.eye(3, 4), "size": (5, 4), "output_spacing": (1, 1), "output_origin": (0, 0)}
    voxels = np.full((4, 5, 6), 7, np.uint8)
    with pytest.raises(ValueError, match=r"SetVolume\(\) comes before Project\(\)"):
        engine.project(**arguments)
    engine.set_volume(voxels, np.eye(3, 4))
    with pytest.raises(ValueError, match=message):
        engine.project(**{**arguments, **wrong})
    assert_array_equal(engine.project(**arguments), np.full((4, 5), 7))


def test_wrong_volumes_are_refused_in_words(engine):
    voxels = np.full((4, 5, 6), 7, np.uint8)
    engine.set_volume(voxels, np.eye(3, 4))
    for bits, size, to_physical, message in (
        (12, (6, 5, 4), np.eye(3, 4), "8 or 16 bits, but they have 12"),
        (8, (6, 0, 4), np.eye(3, 4), r"must not be empty, but its size is \[6, 0, 4\]"),
        (8, (2**20, 2**20, 2**20), np.eye(3, 4), r"at most 2\^31 bytes"),
        (8, (6, 5, 4), np.eye(3, 4) * np.nan, "spacing must be positive and finite"),
        (8, (6, 5, 4), np.c_[np.eye(3), [0, 0, np.inf]], "origin must be finite"),
    ):
        with pytest.raises(ValueError, match=message):
            engine.check(engine.call("SetVolume", bits, *size, to_physical, voxels))
    # the volume before is still there
    assert engine.project(np.eye(3, 4), size=(6, 5), output_spacing=(1, 1), output_origin=(0, 0)).min() == 7
    # each of the axes and the view is good, but not both together
    engine.set_volume(voxels, [[1, 1, 0, 0], [1, 1, 0, 0], [0, 0, 1, 0]])
    with pytest.raises(ValueError, match="Transform and the image's axes together must be finite and invertible"):
        engine.project(np.eye(3, 4))
    engine.set_volume(np.ones((1, 1, 70000), np.uint16), np.eye(3, 4))
    with pytest.raises(ValueError, match="Mode Mean needs at most 65536 voxels"):
        engine.project(np.eye(3, 4), mode=2)


def test_the_page_learns_that_memory_is_missing(engine):
    wasmtime = pytest.importorskip("wasmtime")
    assert engine.call("malloc", 2**32 - 2**16 - 1) == 0
    engine.set_volume(np.ones((4, 4, 4), np.uint16), np.eye(3, 4))
    assert engine.call("malloc", 2**30) and engine.call("malloc", 2**30) and engine.call("malloc", 2**30)
    with pytest.raises(wasmtime.Trap):
        engine.project(np.eye(3, 4), size=(2**15, 2**14), output_spacing=(1, 1), output_origin=(0, 0), depth=True)
    with pytest.raises(ValueError, match="There is no memory"):
        engine.check(1)
