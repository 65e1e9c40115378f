"""The filter as Python users call it: functional and object interface, kinds of input, pipeline."""

import subprocess
import sys

import dask.array
import itk
import numpy as np
import oracle
import pytest
import xarray
from numpy.testing import assert_array_equal
from samples import make_like, make_rotation, needs_proc

Enums = itk.ShearWarpMIPImageFilterEnums
project = itk.shear_warp_mip_image_filter
Anterior = itk.ShearWarpMIPViewEnums.Direction_Anterior


def filter_type(image):
    return itk.ShearWarpMIPImageFilter[type(image), itk.Image[itk.template(image)[1][0], 2]]


# Functional and object interface


def test_functional_interface_with_keywords(image, oblique_view):
    mip = project(
        image,
        transform=oblique_view,
        size=[60, 40],
        output_spacing=[0.5, 0.75],
        output_origin=[-15.0, -14.0],
        default_pixel_value=-1024,
    )
    assert type(mip) is itk.Image[itk.SS, 2]
    assert list(itk.size(mip)) == [60, 40]
    assert list(mip.GetSpacing()) == [0.5, 0.75]
    assert list(mip.GetOrigin()) == [-15.0, -14.0]
    assert itk.array_from_image(mip)[0, 0] == -1024
    assert_array_equal(mip, oracle.project(image, oblique_view, mip, -1024))


# the default of each parameter, and another value
PARAMETERS = {
    "Size": ([0, 0], [12, 34]),
    "OutputSpacing": ([0, 0], [0.25, 0.5]),
    "OutputOrigin": ([0, 0], [-1.0, 2.0]),
    "DefaultPixelValue": (0, -5),
    "Mode": (Enums.Mode_Maximum, Enums.Mode_Minimum),
    "SlabNear": (-np.inf, -6.0),
    "SlabFar": (np.inf, 7.0),
    "CropLower": ([-np.inf] * 3, [10.0, -40.0, 0.0]),
    "CropUpper": ([np.inf] * 3, [1e3, 2e3, 3e3]),
    "MaskLabel": (0, 1),
    "LocalMaximum": (False, True),
    "LocalMaximumThreshold": (0, -100),
    "DepthAttenuation": (0.0, 0.25),
    "ComputeDepth": (False, True),
}


def test_setters_and_getters(image):
    mip = filter_type(image).New(image)

    def check(expected):
        for name, value in expected.items():
            found = getattr(mip, f"Get{name}")()
            found = list(found) if isinstance(value, list) else found
            assert found == value and type(found) is type(value), name

    check({name: default for name, (default, _) in PARAMETERS.items()})
    for name, (_, value) in PARAMETERS.items():
        getattr(mip, f"Set{name}")(value)
    check({name: value for name, (_, value) in PARAMETERS.items()})
    mip.LocalMaximumOff()
    mip.ComputeDepthOff()
    check({"LocalMaximum": False, "ComputeDepth": False})
    assert all(f"{name}: " in str(mip) for name in PARAMETERS)


def test_inputs_and_measures(image, oblique_view):
    mip = filter_type(image).New(image)
    assert mip.GetTransform().GetNameOfClass() == "IdentityTransform"
    assert mip.GetPreparedVolumeSizeInBytes() == 0
    assert mip.GetMaskImage() is None and mip.GetDepthOutput() is None
    mip.SetTransform(oblique_view)
    parameters = list(oblique_view.GetParameters())
    assert list(mip.GetTransform().GetParameters()) == parameters
    assert list(mip.GetTransformInput().Get().GetParameters()) == parameters
    mask = make_like(np.ones((9, 11, 14), np.uint8), image)
    mip.SetMaskImage(mask)
    assert mip.GetMaskImage() == mask
    mip.SetMaskImage(None)
    assert mip.GetMaskImage() is None
    mip.ComputeDepthOn()
    assert type(mip.GetDepthOutput()) is itk.Image[itk.F, 2]
    mip.Update()
    mip.ComputeDepthOff()
    assert mip.GetDepthOutput() is None
    assert mip.GetPrincipalAxis() in (0, 1, 2)
    assert mip.GetPreparationSeconds() >= 0.0
    assert mip.GetProjectionSeconds() > 0.0
    assert mip.GetWarpSeconds() > 0.0
    assert "Transform: " in str(mip) and "InstructionSet: " in str(mip)


def test_slabs_give_the_same_bits(image, oblique_view, tmp_path):
    expected = project(image, transform=oblique_view)
    itk.imwrite(image, tmp_path / "image.mha")
    reader = itk.ImageFileReader[type(image)].New(FileName=str(tmp_path / "image.mha"))
    mip = itk.ShearWarpMIPImageFilter.New(reader.GetOutput(), Transform=oblique_view, NumberOfStreamDivisions=2)
    mip.Update()
    assert_array_equal(mip.GetOutput(), expected)
    depth = reader.GetOutput().GetBufferedRegion().GetSize()[2]
    assert depth < image.GetLargestPossibleRegion().GetSize()[2]


def test_reduced_resampling_and_instruction_sets_never_change_a_pixel(oblique_view, monkeypatch):
    voxels = np.full((40, 70, 60), 11, np.uint16)
    voxels[10:12, 20:50, 30] = 900
    mip = filter_type(itk.image_from_array(voxels)).New(itk.image_from_array(voxels), Transform=oblique_view)
    assert mip.GetReducedResampling() == Enums.ReducedResampling_Auto
    pictures = []
    for name in ("portable", None):
        if name:
            monkeypatch.setenv("SHEARWARPMIP_INSTRUCTION_SET", name)
        else:
            monkeypatch.delenv("SHEARWARPMIP_INSTRUCTION_SET")
        for mode in (Enums.ReducedResampling_Off, Enums.ReducedResampling_On, Enums.ReducedResampling_Auto):
            mip.SetReducedResampling(mode)
            mip.Modified()
            mip.Update()
            assert mip.GetInstructionSet() == name or name is None
            if mode != Enums.ReducedResampling_Auto:
                assert (mip.GetSkippedFraction() > 0) == (mode == Enums.ReducedResampling_On)
            pictures.append(itk.array_from_image(mip.GetOutput()))
    assert all(np.array_equal(picture, pictures[0]) for picture in pictures)

    monkeypatch.setenv("SHEARWARPMIP_INSTRUCTION_SET", "abacus")
    mip.Modified()
    with pytest.raises(RuntimeError, match="abacus"):
        mip.Update()


def test_both_interfaces_fit_the_grid(image, oblique_view):
    def grid(output) -> list[list[float]]:
        return [list(values) for values in (itk.size(output), output.GetSpacing(), output.GetOrigin())]

    expected = project(image, transform=oblique_view)
    mip = filter_type(image).New()
    mip.SetInput(image)
    mip.SetTransform(oblique_view)
    mip.Update()
    assert_array_equal(mip.GetOutput(), expected)
    assert grid(mip.GetOutput()) == grid(expected)

    mip.SetSize([3, 4])
    mip.SetOutputSpacing([2.0, 3.0])
    mip.SetOutputOrigin([0.0, 0.0])
    mip.Update()
    assert grid(mip.GetOutput()) == [[3, 4], [2.0, 3.0], [0.0, 0.0]]
    other = filter_type(image).New(image)
    other.SetOutputParametersFromImage(mip.GetOutput())
    other.Update()
    assert grid(other.GetOutput()) == grid(mip.GetOutput())
    mip.FitOutputGrid()
    mip.Update()
    assert grid(mip.GetOutput()) == grid(expected)


def test_fitted_grid_holds_the_whole_image(image):
    for azimuth in range(0, 180, 15):
        view = itk.ShearWarpMIPView.MakeTransform(image, Anterior, azimuth, 25.0)
        mip = project(image, transform=view, default_pixel_value=-9999)
        pixels = itk.array_from_image(mip)
        spacing = np.array(list(mip.GetSpacing()))
        assert spacing == pytest.approx(0.7)
        center = np.array(list(mip.GetOrigin())) + 0.5 * spacing * (np.array(pixels.shape[::-1]) - 1)
        assert center == pytest.approx(0.0, abs=1e-9)

        # beyond the image's extent the interpolation reaches less than a voxel
        margin = 4
        wider = project(
            image,
            transform=view,
            size=[n + 2 * margin for n in pixels.shape[::-1]],
            output_origin=list(np.array(list(mip.GetOrigin())) - margin * spacing),
            default_pixel_value=-9999,
        )
        around = itk.array_from_image(wider)
        inside = np.s_[margin:-margin, margin:-margin]
        assert_array_equal(around[inside], pixels)
        around[inside] = -9999
        assert (around[[0, -1]] == -9999).all() and (around[:, [0, -1]] == -9999).all()
        assert (around > -9999).sum() < 0.05 * (pixels > -9999).sum()


# what makes a transform of each class
TRANSFORMS = {
    itk.AffineTransform[itk.D, 3]: [("Rotate3D", [1.0, 2.0, 3.0], 1.1), ("Shear", 0, 1, 0.2)],
    itk.CompositeTransform[itk.D, 3]: [("AddTransform", make_rotation(x=0.4)), ("AddTransform", make_rotation(z=0.3))],
    itk.ScaleTransform[itk.D, 3]: [("SetScale", [0.5, 1.5, 2.0])],
    itk.Similarity3DTransform[itk.D]: [("SetRotation", [1.0, 1.0, 0.0], 0.9), ("SetScale", 1.25)],
    itk.TranslationTransform[itk.D, 3]: [("SetOffset", [1.25, -3.5, 8.0])],
    itk.VersorRigid3DTransform[itk.D]: [("SetRotation", [0.0, 1.0, 0.5], 0.7)],
    itk.Euler3DTransform[itk.D]: [("SetRotation", 0.3, 0.2, 1.0)],
    itk.IdentityTransform[itk.D, 3]: [],
}


def make_transform(kind):
    transform = kind.New()
    for method, *arguments in TRANSFORMS[kind]:
        getattr(transform, method)(*arguments)
    return transform


@pytest.mark.parametrize("kind", TRANSFORMS)
def test_any_linear_transform_class(kind, image):
    transform = make_transform(kind)
    mip = project(image, transform=transform, default_pixel_value=-3000)
    pixels = itk.array_from_image(mip)
    assert pixels.max() > 0
    assert_array_equal(pixels, oracle.project(image, transform, mip, -3000))


# Kinds of input


def label_axes(voxels, order="zyx"):
    """A DataArray, in the order of these axes."""
    coordinates = {name: np.arange(length) for name, length in zip("zyx", voxels.shape)}
    return xarray.DataArray(voxels, dims=tuple("zyx"), coords=coordinates).transpose(*order)


def make_read_only(voxels):
    voxels = voxels.copy()
    voxels.flags.writeable = False
    return voxels


ARRAYS = {
    "contiguous": np.array,
    "read-only": make_read_only,
    "strided": lambda a: a[::2, ::-1, 1::3],
    "part": lambda a: a[2:6, 3:9, 4:8],
    "swapped": lambda a: a.transpose(1, 0, 2),
    "rolled": lambda a: a.transpose(2, 0, 1),
    "broadcast": lambda a: np.broadcast_to(a[3], a.shape),
    "Fortran": np.asfortranarray,
    "transposed": lambda a: np.ascontiguousarray(a.T).T,
    "other byte order": lambda a: a.astype(">u2"),
    "Dask": lambda a: dask.array.from_array(np.asfortranarray(a)),
    "DataArray": lambda a: label_axes(np.asfortranarray(a)),
    "DataArray xyz": lambda a: label_axes(np.asfortranarray(a), "xyz"),
    "DataArray yzx": lambda a: label_axes(np.asfortranarray(a), "yzx"),
}


@pytest.mark.parametrize("make", ARRAYS.values(), ids=ARRAYS)
def test_axes_of_arrays_are_zyx_whatever_their_order_in_memory(make, rng):
    source = make(rng.integers(0, 60_000, (9, 10, 11), np.uint16))
    is_labelled = isinstance(source, xarray.DataArray)
    voxels = np.array(source.transpose(*"zyx") if is_labelled else source, np.uint16, order="C")
    mask = np.asfortranarray(rng.integers(0, 2, voxels.shape, np.uint8))
    masked = project(source, mask_image=mask)
    assert_array_equal(masked, (voxels * mask).max(axis=0))
    view = make_rotation(0.4, 0.3, 0.2)
    turned = project(source, transform=view)
    assert_array_equal(turned, project(itk.image_from_array(voxels), transform=view))
    for picture in (masked, turned):
        assert type(picture) is (xarray.DataArray if is_labelled else np.ndarray) and picture.dtype == np.uint16
    front = itk.IdentityTransform[itk.D, 3].New()
    frames = itk.shear_warp_mip_cine_image_filter(source, transforms=[front])
    assert isinstance(frames, xarray.DataArray if is_labelled else np.ndarray)
    assert_array_equal(frames, voxels.max(axis=0)[np.newaxis])
    assert_array_equal(source.transpose(*"zyx") if is_labelled else source, voxels)


@pytest.mark.parametrize("function", [project, itk.shear_warp_mip_cine_image_filter])
@pytest.mark.parametrize(
    "make, kind, text",
    [
        (lambda a: a[:, :1, :1].copy(), ValueError, "shape .9, 1, 1.: give an itk.Image"),
        (lambda a: label_axes(a[:, :1, :1], "xyz"), ValueError, "shape .9, 1, 1.: give an itk.Image"),
        (lambda a: np.ma.masked_less(a, 5), TypeError, "mask_image=.~np.ma.getmaskarray.array."),
        (lambda a: dask.array.ma.masked_less(dask.array.from_array(a), 5), TypeError, "loses its mask"),
    ],
    ids=["n,1,1", "DataArray n,1,1", "masked", "masked Dask"],
)
def test_arrays_that_would_lose_something_are_refused(function, make, kind, text):
    with pytest.raises(kind, match=text):
        function(make(np.ones((9, 10, 11), np.uint16)))


def test_data_array_gives_data_array(rng):
    voxels = xarray.DataArray(
        rng.integers(0, 60_000, (4, 5, 6), np.uint16),
        dims=("z", "y", "x"),
        coords={"z": 100.0 + 3.0 * np.arange(4), "y": -7.0 + 2.0 * np.arange(5), "x": 40.0 + 1.5 * np.arange(6)},
    )
    mip = project(voxels, output_spacing=[1.5, 2.0])
    assert isinstance(mip, xarray.DataArray)
    assert mip.dims == ("y", "x")
    assert mip.dtype == np.uint16
    np.testing.assert_allclose(mip.coords["y"], voxels.coords["y"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(mip.coords["x"], voxels.coords["x"], rtol=0, atol=1e-9)
    assert_array_equal(mip, voxels.max("z"))
    labels = voxels.copy(data=rng.integers(0, 2, (4, 5, 6), np.uint8))
    near = project(voxels, mask_image=labels, output_spacing=[1.5, 2.0], slab_near=102.0)
    assert isinstance(near, xarray.DataArray) and near.dims == ("y", "x")
    assert_array_equal(near, (voxels * labels)[1:].max("z"))

    image = itk.image_from_xarray(voxels)
    view = itk.ShearWarpMIPView.MakeTransform(image, Anterior, 20.0)
    turned = project(voxels, transform=view)
    expected = project(image, transform=view)
    assert turned.dims == ("y", "x")
    assert_array_equal(turned, expected)
    assert float(turned.coords["x"][0]) == expected.GetOrigin()[0]
    assert float(turned.coords["y"][1] - turned.coords["y"][0]) == pytest.approx(expected.GetSpacing()[1])


def test_volume_one_voxel_thick():
    voxels = np.full((1, 4, 5), 9, np.uint8)
    edge_on = project(voxels, transform=make_rotation(x=np.pi / 2))
    assert edge_on.shape == (1, 5)
    assert (edge_on == 9).all()


# Pipeline


def count_events(process, event) -> list:
    events = []
    process.AddObserver(event, lambda: events.append(None))
    return events


@pytest.mark.parametrize("extension", [".nrrd", ".mha"])
def test_pipeline_from_reader_to_writer(extension, image, tmp_path):
    itk.imwrite(image, tmp_path / f"volume{extension}")
    view = make_transform(itk.AffineTransform[itk.D, 3])

    reader = itk.ImageFileReader[type(image)].New(FileName=str(tmp_path / f"volume{extension}"))
    cast = itk.CastImageFilter[type(image), itk.Image[itk.F, 3]].New(reader.GetOutput())
    mip = filter_type(cast.GetOutput()).New(cast.GetOutput(), Transform=view)
    writer = itk.ImageFileWriter.New(mip.GetOutput(), FileName=str(tmp_path / f"mip{extension}"))
    reads = count_events(reader, itk.EndEvent())
    projections = count_events(mip, itk.EndEvent())

    writer.Update()
    assert (len(reads), len(projections)) == (1, 1)
    written = itk.imread(tmp_path / f"mip{extension}")
    assert_array_equal(written, oracle.project(cast.GetOutput(), view, mip.GetOutput()))
    assert list(written.GetSpacing()) == pytest.approx(list(mip.GetOutput().GetSpacing()))
    assert list(written.GetOrigin()) == pytest.approx(list(mip.GetOutput().GetOrigin()))

    mip.Update()
    mip.SetDefaultPixelValue(mip.GetDefaultPixelValue())
    mip.Update()
    assert (len(reads), len(projections)) == (1, 1)

    view.Rotate3D([1.0, 0.0, 0.0], 0.3)
    writer.Update()
    assert (len(reads), len(projections)) == (1, 2)  # the transform was changed in place
    changed = itk.imread(tmp_path / f"mip{extension}")
    assert_array_equal(changed, oracle.project(cast.GetOutput(), view, mip.GetOutput()))

    reader.Modified()
    mip.Update()
    assert (len(reads), len(projections)) == (2, 3)


@pytest.mark.parametrize("order", ["extract, mip", "mip, extract"])
def test_works_beside_other_filters(order, isolated):
    outcome = isolated(f"""
image = itk.image_from_array(np.ones((9, 9, 9), np.int16))
def extract():
    return itk.extract_image_filter(image, extraction_region=image.GetLargestPossibleRegion())
def mip():
    return itk.shear_warp_mip_image_filter(image)
for run in ({order}, {order}):
    assert np.asarray(run()).max() == 1
""")
    assert outcome.returncode == 0, outcome.stderr


def test_leaves_the_global_threader_alone(isolated):
    outcome = isolated("""
itk.shear_warp_mip_image_filter(np.ones((9, 9, 9), np.int16))
print(itk.MultiThreaderBase.GetGlobalDefaultThreader())
""")
    default = isolated("print(itk.MultiThreaderBase.GetGlobalDefaultThreader())")
    assert outcome == default


# Cine


def test_views_prepare_what_further_ones_need(rng):
    image = itk.image_from_array(rng.integers(0, 60_000, (40, 50, 60), np.uint16))
    mip = filter_type(image).New(image)
    axes, preparations, held = [], [], []
    for azimuth in range(0, 360, 15):
        view = itk.ShearWarpMIPView.MakeTransform(image, Anterior, float(azimuth))
        mip.SetTransform(view)
        mip.Update()
        axes.append(mip.GetPrincipalAxis())
        preparations.append(mip.GetPreparationSeconds())
        held.append(mip.GetPreparedVolumeSizeInBytes())
    assert set(axes) == {0, 1}
    first = axes.index(0)
    block_maxima = 8 * 7 * 5 * 2
    volume = 40 * 50 * 60 * 2 + block_maxima
    # and the intermediate images
    assert axes[: first + 2] == [1] * first + [0, 0] and first > 1
    assert min(held[1:first]) > block_maxima and max(held[: first + 1]) < volume
    assert min(held[first + 1 :]) > volume
    assert [n for n, seconds in enumerate(preparations) if seconds > 0] == [1, first, first + 1]

    image.Modified()
    mip.SetTransform(make_rotation(y=np.pi / 2))
    mip.Update()
    assert mip.GetPreparedVolumeSizeInBytes() < volume
    mip.Modified()
    mip.Update()
    assert mip.GetPreparedVolumeSizeInBytes() > volume


def test_cine_follows_changed_voxels(image):
    """A second view along x makes a copy: it must not be an old one."""
    view = make_rotation(y=np.pi / 2)
    mip = filter_type(image).New(image, Transform=view)
    mip.Update()
    mip.Modified()
    mip.Update()
    before = itk.array_from_image(mip.GetOutput())
    itk.array_view_from_image(image)[4, 5, 6] = 5000
    mip.Update()
    assert_array_equal(mip.GetOutput(), before)
    image.Modified()
    mip.Update()
    assert_array_equal(mip.GetOutput(), oracle.project(image, view, mip.GetOutput()))


def test_release_prepared_volume(image):
    view = itk.AffineTransform[itk.D, 3].New()
    x_axis = itk.array_from_matrix(image.GetDirection())[:, [1, 2, 0]]
    view.SetMatrix(itk.matrix_from_array(x_axis))
    mip = filter_type(image).New(image, Transform=view)
    mip.Update()
    mip.Modified()
    mip.Update()
    before = itk.array_from_image(mip.GetOutput())
    assert mip.GetPrincipalAxis() == 0
    assert mip.GetPreparedVolumeSizeInBytes() > (9 * 11 * 14 + 2 * 2 * 2) * 2
    mip.ReleasePreparedVolume()
    assert mip.GetPreparedVolumeSizeInBytes() == 0
    mip.Modified()
    mip.Update()
    assert mip.GetPreparationSeconds() > 0
    assert_array_equal(mip.GetOutput(), before)


# resident memory in MiB, and a view along x of 256 MiB
_LARGE_X_VIEW = """
def resident():
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) / 1024 for line in status if line.startswith("VmRSS"))

image = itk.image_view_from_array(np.ones((256, 1024, 1024), np.uint8))
view = itk.Euler3DTransform[itk.D].New()
view.SetRotation(0.0, np.pi / 2, 0.0)
"""


@needs_proc
@pytest.mark.parametrize("how", ["mip.ReleasePreparedVolume()", "del mip"])
def test_memory_of_the_prepared_volume_is_freed(how, isolated):
    outcome = isolated(f"""{_LARGE_X_VIEW}
mip = itk.ShearWarpMIPImageFilter.New(image, Transform=view)
before = resident()
mip.Update()
first = resident() - before
mip.Modified()
mip.Update()
held = resident() - before
{how}
freed = before + held - resident()
assert first < 40, first
assert 250 < held < 290, held
assert 250 < freed < 290, freed
""")
    assert outcome.returncode == 0, outcome.stderr


@needs_proc
def test_functional_interface_keeps_no_prepared_volume(isolated):
    outcome = isolated(f"""{_LARGE_X_VIEW}
before = resident()
mip = itk.shear_warp_mip_image_filter(image, transform=view)
assert resident() - before < 30, resident() - before
assert itk.size(mip)[0] == 256
""")
    assert outcome.returncode == 0, outcome.stderr


def test_functional_interface_gives_an_array_of_its_own():
    pictures = [np.asarray(project(np.full((9, 200, 300), n, np.int16))) for n in range(9)]
    for n, picture in enumerate(pictures):
        assert type(picture) is np.ndarray and picture.flags.owndata
        assert (picture == n).all()


# Progress and abort


def test_progress_and_abort_by_observers(rng):
    image = itk.image_from_array(rng.integers(0, 255, (160, 180, 200), np.uint8))
    mip = filter_type(image).New(image, Transform=make_rotation(0.1, 0.2, 0.3))
    mip.SetNumberOfWorkUnits(1)
    tag = mip.AddObserver(itk.ProgressEvent(), mip.AbortGenerateDataOn)
    aborts = count_events(mip, itk.AbortEvent())
    with pytest.raises(RuntimeError, match="aborted by an external request"):
        mip.Update()
    assert aborts
    mip.RemoveObserver(tag)
    mip.AbortGenerateDataOff()
    seen = []
    mip.AddObserver(itk.ProgressEvent(), lambda: seen.append(mip.GetProgress()))
    mip.Update()
    assert_array_equal(mip.GetOutput(), oracle.project(image, mip.GetTransform(), mip.GetOutput()))
    assert len(seen) > 5
    assert seen == sorted(seen)
    assert 0.0 <= seen[0] < 0.5
    assert mip.GetProgress() == pytest.approx(1.0)


# Other threads of Python


@pytest.mark.parametrize(
    ("name", "updates"),
    [
        ("ShearWarpMIPImageFilter", "process.Update, process.UpdateLargestPossibleRegion"),
        ("ShearWarpMIPCineImageFilter", "process.Update, process.UpdateLargestPossibleRegion"),
        ("ShearWarpMIPPartsImageFilter", "lambda: process.ProjectPart(image), process.Update"),
    ],
)
def test_other_threads_run_during_an_update(name, updates, isolated):
    outcome = isolated(f"""
import sys, threading, time
image = itk.image_from_array(np.ones((64, 256, 256), np.uint8))
process = itk.{name}.New(image)
if hasattr(process, "AddPart"):
    process.AddPart(process.ProjectPart(image))
seen, done = [0], threading.Event()
def count():
    while not done.is_set():
        seen[0] += 1
        time.sleep(0)
# no thread gets Python's lock unless another one gives it up
sys.setswitchinterval(1000)
threading.Thread(target=count).start()
for update in ({updates}):
    for _ in range(100):
        process.Modified()
        before = seen[0]
        update()
        if seen[0] > before:
            break
    else:
        raise AssertionError("none ran")
done.set()
""")
    assert outcome.returncode == 0, outcome.stderr


def test_a_daemon_thread_in_an_update_ends_with_python():
    code = """
import threading, time, itk, numpy as np
cine = itk.ShearWarpMIPCineImageFilter.New(itk.image_from_array(np.ones((64, 256, 256), np.uint16)), size=[8, 8])
cine.SetIntermediateMemory(1 << 26)
# for seconds
cine.SetNumberOfFrames(4_001)
threading.Thread(target=cine.Update, daemon=True).start()
time.sleep(0.3)
"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")


def test_an_observer_may_invoke_the_start(isolated):
    outcome = isolated("""
mip = itk.ShearWarpMIPImageFilter.New(itk.image_from_array(np.ones((64, 64, 64), np.uint8)))
mip.AddObserver(itk.ProgressEvent(), lambda: mip.InvokeEvent(itk.StartEvent()))
mip.Update()
""")
    assert outcome.returncode == 0, outcome.stderr


@pytest.mark.parametrize("divisions", [1, 8])
def test_a_signal_ends_an_update(divisions, isolated):
    outcome = isolated(f"""
import signal
voxels = np.random.default_rng(1).integers(0, 60_000, (64, 256, 256), np.uint16)
cine = itk.ShearWarpMIPCineImageFilter.New(itk.image_from_array(voxels), size=[8, 8])
cine.SetIntermediateMemory(1 << 26)
# for seconds
cine.SetNumberOfFrames(4_001)
cine.SetNumberOfStreamDivisions({divisions})
aborts = []
cine.AddObserver(itk.AbortEvent(), lambda: aborts.append(None))
signal.signal(signal.SIGALRM, signal.default_int_handler)
signal.setitimer(signal.ITIMER_REAL, 0.2)
try:
    cine.Update()
except KeyboardInterrupt:
    assert aborts
else:
    raise AssertionError("it went on")
cine.SetNumberOfFrames(2)
cine.Update()
assert np.asarray(cine.GetOutput()).max() > 50_000
""")
    assert outcome.returncode == 0, outcome.stderr


@pytest.mark.parametrize("divisions", [1, 2])
def test_python_before_the_filter(divisions, rng):
    """Python's own filters need its lock."""
    image = itk.image_from_array(rng.integers(0, 60_000, (19, 10, 11), np.uint16))
    invert = itk.PyImageFilter[type(image), type(image)].New(image)
    lengths = []

    def generate(process):
        output = process.GetOutput()
        region = output.GetRequestedRegion()
        output.SetBufferedRegion(region)
        output.Allocate()
        first, length = region.GetIndex()[2], region.GetSize()[2]
        lengths.append(length)
        voxels = itk.array_view_from_image(image)[first : first + length]
        itk.array_view_from_image(output, update=False)[:] = 60_000 - voxels

    invert.SetPyGenerateData(generate)
    # ITK gives it its own Python object here
    invert.UpdateOutputInformation()
    mip = itk.ShearWarpMIPImageFilter.New(invert.GetOutput(), NumberOfStreamDivisions=divisions)
    mip.Update()
    assert len(lengths) == divisions
    expected = 60_000 - np.asarray(image).min(axis=0)
    assert_array_equal(mip.GetOutput(), expected)
