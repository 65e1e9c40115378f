"""What is known of an image beside voxels and geometry goes where the image goes, as far as ITK lets it."""

import copy
import multiprocessing
import pickle

import itk
import numpy as np
import pytest
import SimpleITK
from itk_shearwarpmip import _entries, mip, open_image, turn
from numpy.testing import assert_array_equal
from samples import make_oblique

KEPT = {
    "pickle": lambda image: pickle.loads(pickle.dumps(image)),
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "spawn": lambda image: spawn(_give_back, image),
    "NRRD": lambda image: write_and_read(image, ".nrrd"),
    "MetaImage": lambda image: write_and_read(image, ".mha"),
    "another place": lambda image: open_image(image, origin=(1, 2, 3)[: image.GetImageDimension()]),
}
LOST = {
    "filter": lambda image: itk.median_image_filter(image, radius=0),
    "duplicator": itk.image_duplicator,
}


def _give_back(image):
    return image, _entries.has_direction(image), _entries.is_inverted(image)


def spawn(function, *arguments):
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        image, has_direction, is_inverted = pool.apply(function, arguments)
    assert has_direction is _entries.has_direction(image) and is_inverted is _entries.is_inverted(image)
    return image


def write_and_read(image, suffix):
    import tempfile
    from pathlib import Path

    with tempfile.TemporaryDirectory() as folder:
        itk.imwrite(image, Path(folder) / f"image{suffix}")
        return itk.imread(Path(folder) / f"image{suffix}")


@pytest.fixture
def volume(rng):
    """An image in micrometers of which nobody stated how it lies in the patient, and that is to be shown inverted."""
    image = open_image(np.asarray(make_oblique(rng)), spacing=(0.5, 0.6, 0.7))
    image["IsInverted"], image["Unit"] = "1", "um"
    return image


def assert_known(image):
    assert not _entries.has_direction(image)
    assert _entries.is_inverted(image)
    assert _entries.get_unit(image) == "um"


@pytest.mark.parametrize("way", KEPT)
def test_volumes_keep_what_is_known(way, volume):
    image = KEPT[way](volume)
    assert_known(image)
    assert_array_equal(image, volume)
    picture = mip(image)
    assert_known(picture)


@pytest.mark.parametrize("way", [way for way in KEPT if way != "another place"])
def test_pictures_keep_what_is_known(way, volume):
    picture = mip(volume, azimuth=30, background=-7)
    found = KEPT[way](picture)
    assert_known(found)
    assert_array_equal(found, picture)
    if way == "NRRD":
        # in which ITK writes only texts
        assert _entries.get_view(found) is None
        return
    assert float(found["Background"]) == -7
    assert np.allclose(_entries.get_view(found), _entries.get_view(picture), atol=1e-5)


def test_other_packages_keep_what_is_known(volume, tmp_path):
    itk.imwrite(volume, tmp_path / "image.nrrd")
    for image in (itk.xarray_from_image(volume), SimpleITK.ReadImage(tmp_path / "image.nrrd")):
        assert_known(open_image(image))


@pytest.mark.parametrize("way", LOST)
def test_itk_itself_loses_entries(way, volume):
    """The documentation says so: this notices when it changes."""
    assert not LOST[way](volume).GetMetaDataDictionary().GetKeys()


def test_turns_are_pickled_whole(volume, rng):
    series = turn(volume, frames=3, azimuth=30)
    found = pickle.loads(pickle.dumps(series))
    assert_known(found.frames)
    assert found.frames["FrameAngles"] == series.frames["FrameAngles"]
    assert found.frames["FrameTransforms"] == series.frames["FrameTransforms"]
    assert found.source_metadata == series.source_metadata and found.window == series.window
    assert_array_equal(found.frames, series.frames)


def test_depths_can_be_turned_into_points(rng):
    voxels = np.zeros((9, 11, 14), np.uint8)
    voxels[2, 3, 4] = 200
    picture, depths = mip(voxels, "left", azimuth=20, depth=True, geometry=True, spacing=(0.5, 0.6, 0.7))
    row, column = np.unravel_index(np.argmax(picture), np.asarray(picture).shape)
    u, v = picture.TransformIndexToPhysicalPoint([int(column), int(row)])
    center = itk.ShearWarpMIPView.GetCenter(open_image(voxels, spacing=(0.5, 0.6, 0.7)))
    matrix = np.reshape(picture["FrameTransforms"], (4, 4))
    depth = np.asarray(depths)[row, column]
    point = (matrix @ [u, v, depth, 1])[:3]
    assert np.linalg.norm(point - np.array([2.0, 1.8, 1.4])) < 0.6, (point, list(center))


def test_geometry_is_of_arrays_too(rng):
    voxels = rng.integers(0, 99, (4, 5, 6), np.int16)
    assert isinstance(mip(voxels), np.ndarray)
    picture = mip(voxels, geometry=True, spacing=(1, 1, 2))
    assert list(picture.GetSpacing()) == [1, 1] and picture["HasOrientation"] == "0"
    with pytest.raises(ValueError, match="geometry must be True or False"):
        mip(voxels, geometry=1)


def test_masks_with_axes_of_one(rng):
    voxels = rng.integers(1, 99, (1, 1, 6), np.int16)
    assert_array_equal(mip(voxels, mask=voxels > 50), np.where(voxels > 50, voxels, 0)[0, :, ::1])
    image = open_image(voxels, spacing=(1, 2, 3))
    assert mip(image, mask=voxels > 0).GetLargestPossibleRegion().GetSize()[0] == 6


class MetaTensor:
    """As MONAI's: axes x, y, z, perhaps behind a channel, and an affine."""

    def __init__(self, array, affine, space):
        self._array, self.affine, self.meta, self.shape = array, affine, {"space": space}, array.shape

    def as_tensor(self):
        return self._array


MetaTensor.__module__ = "monai.data.meta_tensor"


@pytest.mark.parametrize("space", ["RAS", "LPS"])
@pytest.mark.parametrize("channels", [0, 1])
def test_tensors_of_monai_lie_where_they_say(space, channels, rng):
    image = make_oblique(rng)
    affine = np.eye(4)
    affine[:3, :3] = itk.array_from_matrix(image.GetDirection()) * list(image.GetSpacing())
    affine[:3, 3] = list(image.GetOrigin())
    affine = affine if space == "LPS" else np.diag([-1, -1, 1, 1]) @ affine
    voxels = np.asarray(image).T[(np.newaxis,) * channels]
    found = open_image(MetaTensor(voxels, affine, space))
    assert_array_equal(found, image)
    assert np.allclose(found.GetOrigin(), image.GetOrigin()) and np.allclose(found.GetSpacing(), image.GetSpacing())
    assert np.allclose(found.GetDirection(), image.GetDirection())
    assert not found.GetMetaDataDictionary().HasKey("HasOrientation")
    # a picture with a place of its own
    assert_array_equal(mip(MetaTensor(voxels, affine, space), size=(9, 9)), mip(found, size=(9, 9)))
    with pytest.raises(ValueError, match="must be in the space RAS or LPS"):
        open_image(MetaTensor(voxels, affine, "scanner"))
    with pytest.raises(ValueError, match="or one channel before them"):
        open_image(MetaTensor(np.zeros((2, 3, 4, 5)), affine, space))
