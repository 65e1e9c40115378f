"""Modes, slabs, boxes, masks, local maxima, fading, depth and the output in physical space."""

import itk
import numpy as np
import oracle
import pytest
from numpy.testing import assert_array_equal
from oracle import Rule
from samples import make_like
from test_oracle import DTYPES, random_image, random_view

project = itk.shear_warp_mip_image_filter
Enums = itk.ShearWarpMIPImageFilterEnums
MODES = {
    "maximum": Enums.Mode_Maximum, "minimum": Enums.Mode_Minimum, "absolute": Enums.Mode_AbsoluteMaximum,
    "mean": Enums.Mode_Mean,
}  # fmt: skip
SLICE = itk.Image[itk.SS, 3], itk.Image[itk.SS, 3]


def keywords(rule: Rule) -> dict:
    """Those that the functional interface takes for a rule."""
    changed = {name: value for name, value in rule._asdict().items() if value is not Rule._field_defaults[name]}
    return changed | ({"mode": MODES[rule.mode]} if "mode" in changed else {})


def set_rule(mip, rule: Rule) -> None:
    for name, value in keywords(rule).items():
        getattr(mip, "Set" + name.title().replace("_", ""))(value)


def physical_point(image, index) -> list[float]:
    """Of a continuous index."""
    axes = itk.array_from_matrix(image.GetDirection()) @ np.diag(list(image.GetSpacing()))
    return (axes @ index + list(image.GetOrigin())).tolist()


@pytest.fixture
def labels(rng) -> np.ndarray:
    """Of ``image``: blobs of 0, 1 and 2."""
    return rng.integers(0, 3, (3, 4, 5)).repeat(3, 0).repeat(3, 1).repeat(3, 2)[:9, :11, :14]


def random_rule(rng: np.random.Generator, image, view) -> Rule:
    voxels = itk.array_view_from_image(image)
    rule = Rule(mode=str(rng.choice(list(MODES))))
    if rng.random() < 0.4:
        near, far = np.sort(rng.normal(size=2) * 8.0).tolist()
        if rng.random() < 0.3:
            # of no thickness, in the first or the last voxel, where oblique views have samples
            size = np.array(voxels.shape[::-1]) - 1
            index = np.array(list(image.GetLargestPossibleRegion().GetIndex())) + size * rng.integers(0, 2, 3)
            point = image.TransformIndexToPhysicalPoint(index.tolist())
            near = far = view.GetInverseTransform().TransformPoint(point)[2]
        rule = rule._replace(slab_near=near, slab_far=far)
    if rng.random() < 0.4:
        center = np.array(list(itk.ShearWarpMIPView.GetCenter(image)))
        lower, upper = center - rng.uniform(0, 8, 3), center + rng.uniform(0, 8, 3)
        rule = rule._replace(crop_lower=tuple(lower.tolist()), crop_upper=tuple(upper.tolist()))
    if rng.random() < 0.5:
        mask = make_like(rng.integers(0, 3, voxels.shape).astype(np.uint8), image)
        rule = rule._replace(mask_image=mask, mask_label=int(rng.integers(3)))
    if rule.mode in ("maximum", "minimum") and rng.random() < 0.5:
        threshold = rng.choice(voxels.ravel()).item()
        rule = rule._replace(local_maximum=True, local_maximum_threshold=threshold)
    return rule


@pytest.mark.parametrize("dtype", DTYPES)
def test_random_rules_of_random_views(dtype):
    rng = np.random.default_rng(327_336)
    hits = misses = 0
    for _ in range(25):
        image = random_image(rng, dtype)
        view = random_view(rng, image)
        rule = random_rule(rng, image, view)
        oversampling = int(rng.integers(1, 3))
        has_depth = rule.mode != "mean"
        mip = itk.ShearWarpMIPImageFilter.New(
            image, Transform=view, Oversampling=oversampling, DefaultPixelValue=7, ComputeDepth=has_depth
        )
        set_rule(mip, rule)
        mip.Update()
        output = mip.GetOutput()
        values, depths = oracle.project_rays(image, view, output, rule, 7, oversampling)
        assert_array_equal(output, values)
        if not has_depth:
            continue
        np.testing.assert_allclose(mip.GetDepthOutput(), depths, rtol=1e-6, atol=1e-5)
        hits += np.isfinite(depths).sum()
        misses += np.isnan(depths).sum()
    assert hits > 1_000 and misses > 1_000


RULES = {
    "minimum": Rule(mode="minimum"),
    "absolute maximum": Rule(mode="absolute"),
    "mean": Rule(mode="mean", slab_near=-3.0),
    "slab": Rule(slab_near=-3.0, slab_far=2.0),
    "near end": Rule(slab_near=1.0),
    "far end": Rule(slab_far=-2.5),
    "box": Rule(crop_lower=(12.0, -28.0, 8.0), crop_upper=(20.0, -24.0, 15.0)),
    "lower corner": Rule(crop_lower=(-np.inf, -27.0, -np.inf)),
    "mask": Rule(mask_image="labels"),
    "label": Rule(mask_image="labels", mask_label=2),
    "local maximum": Rule(local_maximum=True, local_maximum_threshold=300),
    "local minimum": Rule(mode="minimum", local_maximum=True, local_maximum_threshold=-200),
    "fading": Rule(depth_attenuation=0.06),
    "all": Rule(
        mode="minimum",
        slab_near=-6.0,
        slab_far=7.0,
        crop_lower=(10.0, -40.0, 0.0),
        mask_image="labels",
        mask_label=1,
        local_maximum=True,
        local_maximum_threshold=-100,
    ),
}


@pytest.mark.parametrize("rule", RULES.values(), ids=RULES)
def test_each_parameter_in_both_interfaces(rule, image, labels, oblique_view):
    if rule.mask_image:
        rule = rule._replace(mask_image=make_like(labels.astype(np.uint8), image))
    plain = project(image, transform=oblique_view, default_pixel_value=-1500)
    functional = project(image, transform=oblique_view, default_pixel_value=-1500, **keywords(rule))
    assert type(functional) is itk.Image[itk.SS, 2]
    pixels = itk.array_from_image(functional)
    assert (pixels != itk.array_from_image(plain)).any()

    mip = itk.ShearWarpMIPImageFilter.New(image, Transform=oblique_view, DefaultPixelValue=-1500)
    set_rule(mip, rule)
    mip.Update()
    assert_array_equal(mip.GetOutput(), pixels)

    expected, _ = oracle.project_rays(image, oblique_view, functional, rule, -1500)
    if rule.depth_attenuation:
        # exp() may differ in its last digit
        assert abs(pixels.astype(int) - expected).max() <= 1
        assert (pixels == expected).mean() > 0.99
    else:
        assert_array_equal(pixels, expected)


# Depth


@pytest.mark.parametrize("azimuth, elevation", [(0, 0), (35, 20), (-70, 10), (150, -40), (10, 80)])
def test_depth_leads_to_the_bright_voxel(azimuth, elevation, image):
    left = itk.ShearWarpMIPViewEnums.Direction_Left
    view = itk.ShearWarpMIPView.MakeTransform(image, left, float(azimuth), float(elevation))
    voxels = itk.array_view_from_image(image)
    voxels[:] = 0
    voxels[3, 6, 9] = 1000
    mip = itk.ShearWarpMIPImageFilter.New(image, Transform=view, ComputeDepth=True)
    mip.Update()
    pixels = itk.array_from_image(mip.GetOutput())
    brightest = np.unravel_index(pixels.argmax(), pixels.shape)[::-1]
    column, row = map(int, brightest)

    point = mip.GetPhysicalPoint([column, row])
    place = np.array(list(point))
    expected = np.array(list(image.TransformIndexToPhysicalPoint([9, 6, 3])))
    assert np.linalg.norm(place - expected) < max(image.GetSpacing())
    axis = mip.GetPrincipalAxis()
    assert image.TransformPhysicalPointToIndex(point)[axis] == [9, 6, 3][axis]
    depth = mip.GetDepthOutput()
    in_view = [*depth.TransformIndexToPhysicalPoint([column, row]), depth.GetPixel([column, row])]
    assert place == pytest.approx(list(view.TransformPoint(in_view)))


@pytest.mark.parametrize("dtype", DTYPES)
def test_nearest_has_only_values_of_voxels(dtype, oblique_view, image, rng):
    labels = make_like(rng.choice(np.array([3, 90], dtype), itk.array_view_from_image(image).shape), image)
    nearest = Enums.Interpolation_Nearest
    picture = project(labels, transform=oblique_view, default_pixel_value=7, interpolation=nearest)
    assert set(np.unique(picture)) == {3, 7, 90}
    assert len(np.unique(project(labels, transform=oblique_view, default_pixel_value=7))) > 3


def test_depth_is_an_image_of_the_same_grid(image, oblique_view):
    mip = itk.ShearWarpMIPImageFilter.New(image, Transform=oblique_view)
    mip.ComputeDepthOn()
    # by itself
    depth = mip.GetDepthOutput()
    depth.Update()
    output = mip.GetOutput()
    assert list(itk.size(depth)) == list(itk.size(output))
    assert depth.GetSpacing() == output.GetSpacing()
    assert depth.GetOrigin() == output.GetOrigin()
    plain, functional = (
        project(image, transform=oblique_view, default_pixel_value=-2000, compute_depth=each) for each in (False, True)
    )
    assert type(functional) is itk.Image[itk.SS, 2]
    assert_array_equal(functional, plain)
    expected = itk.array_from_image(depth)
    assert_array_equal(np.isnan(expected), itk.array_from_image(plain) == -2000)
    del mip, output
    assert_array_equal(depth, expected)


# Output in physical space


def test_two_dimensions_are_the_default(image):
    flat = itk.Image[itk.SS, 2]
    for mip in (
        itk.ShearWarpMIPImageFilter.New(image),
        itk.ShearWarpMIPImageFilter.New(Input=image),
        itk.ShearWarpMIPImageFilter.New(image, ttype=(SLICE[0], flat)),
        itk.ShearWarpMIPImageFilter[SLICE[0], flat].New(image),
    ):
        assert type(mip.GetOutput()) is flat
    for mip in (
        itk.ShearWarpMIPImageFilter.New(image, ttype=SLICE),
        itk.ShearWarpMIPImageFilter.New(image, ttype=list(SLICE)),
        itk.ShearWarpMIPImageFilter[SLICE].New(image),
    ):
        assert type(mip.GetOutput()) is SLICE[1]
    assert type(project(image)) is flat
    assert type(project(image, ttype=SLICE)) is SLICE[1]
    with pytest.raises(itk.TemplateTypeError, match="ShearWarpMIPImageFilter"):
        itk.ShearWarpMIPImageFilter.New(itk.Image[itk.UL, 3].New())


@pytest.mark.parametrize("dtype", DTYPES)
def test_slice_has_the_pixels_of_the_flat_output(dtype, oblique_view, rng):
    image = itk.image_from_array(rng.integers(0, 100, (6, 7, 8)).astype(dtype))
    volume = project(image, transform=oblique_view, ttype=(type(image), type(image)))
    flat = project(image, transform=oblique_view)
    assert type(volume) is type(image)
    assert_array_equal(itk.array_from_image(volume)[0], flat)


@pytest.mark.parametrize("slab", [None, (-3.0, 5.0)])
def test_slice_lies_where_its_rays_begin_and_end(slab, image, oblique_view):
    near_far = dict(zip(("SlabNear", "SlabFar"), slab or ()))
    mip = itk.ShearWarpMIPImageFilter.New(image, ttype=SLICE, Transform=oblique_view, ComputeDepth=True, **near_far)
    flat = itk.ShearWarpMIPImageFilter.New(image, Transform=oblique_view, ComputeDepth=True, **near_far)
    mip.Update()
    flat.Update()
    output, grid = mip.GetOutput(), flat.GetOutput()
    assert list(itk.size(output)) == [*itk.size(grid), 1]
    inverse = oblique_view.GetInverseTransform()
    ends = np.array(np.meshgrid(*([-0.5, size - 0.5] for size in itk.size(image)))).reshape(3, -1)
    depths = [inverse.TransformPoint(physical_point(image, end))[2] for end in ends.T]
    nearest, farthest = slab or (min(depths), max(depths))
    assert output.GetSpacing()[2] == pytest.approx(farthest - nearest)
    width, height = itk.size(grid)
    for u, v, end in [(0, 0, 0.0), (width - 1, 0, -0.5), (3, height - 1, 0.5), (7, 5, 0.25)]:
        w = 0.5 * (nearest + farthest) + end * (farthest - nearest)
        expected = oblique_view.TransformPoint([*grid.TransformIndexToPhysicalPoint([u, v]), w])
        assert physical_point(output, [u, v, end]) == pytest.approx(list(expected))
    assert type(mip.GetDepthOutput()) is itk.Image[itk.F, 3]
    assert mip.GetDepthOutput().GetDirection() == output.GetDirection()
    assert mip.GetPhysicalPoint([width // 2, height // 2, 0]) == flat.GetPhysicalPoint([width // 2, height // 2])


def test_slice_finds_its_place_after_a_file(image, oblique_view, tmp_path):
    mip = project(image, transform=oblique_view, ttype=SLICE)
    itk.imwrite(mip, tmp_path / "mip.nrrd")
    read = itk.imread(tmp_path / "mip.nrrd")
    assert_array_equal(read, mip)
    assert list(read.TransformIndexToPhysicalPoint([3, 4, 0])) == pytest.approx(
        list(mip.TransformIndexToPhysicalPoint([3, 4, 0]))
    )


def test_filters_of_both_outputs_use_the_thread_pool(image):
    for mip in (
        itk.ShearWarpMIPImageFilter.New(image),
        itk.ShearWarpMIPImageFilter.New(image, ttype=SLICE),
        itk.ShearWarpMIPImageFilter.New(image, ttype=SLICE).Clone(),
    ):
        assert mip.GetMultiThreader().GetNameOfClass() == "PoolMultiThreader"


# Kinds of input


def test_arrays_as_image_and_mask(rng):
    voxels = rng.integers(0, 60_000, (5, 6, 7), np.uint16)
    labels = rng.integers(0, 3, (5, 6, 7), np.uint8)
    flags = labels == 2
    inside = np.where(flags, voxels, 0).max(axis=0)
    # one array makes the result an array
    for source, mask, label in (
        (voxels, labels, 2),
        (itk.image_from_array(voxels), labels, 2),
        (voxels, flags.astype(np.uint8), 0),
        (voxels, flags.view(np.uint8), 0),
    ):
        mip = project(source, mask_image=mask, mask_label=label)
        assert isinstance(mip, np.ndarray)
        assert_array_equal(mip, inside)
    minimum = project(voxels, mode=Enums.Mode_Minimum)
    assert_array_equal(minimum, voxels.min(axis=0))


def test_mask_from_a_pipeline(image, oblique_view):
    threshold = itk.BinaryThresholdImageFilter[SLICE[0], itk.Image[itk.UC, 3]].New(
        image, LowerThreshold=-400, UpperThreshold=300
    )
    mip = itk.ShearWarpMIPImageFilter.New(
        image, Transform=oblique_view, MaskImage=threshold.GetOutput(), DefaultPixelValue=-2000
    )
    for upper in (300, 600):
        threshold.SetUpperThreshold(upper)
        mip.Update()
        pixels = itk.array_from_image(mip.GetOutput())
        rule = Rule(mask_image=threshold.GetOutput())
        assert_array_equal(pixels, oracle.project_rays(image, oblique_view, mip.GetOutput(), rule, -2000)[0])
        assert 0 < pixels.max() <= upper


def test_mask_changed_in_place(image, labels, oblique_view):
    mask = make_like(labels.astype(np.uint8), image)
    mip = itk.ShearWarpMIPImageFilter.New(image, Transform=oblique_view, MaskImage=mask)
    mip.Update()
    itk.array_view_from_image(mask)[:] = 0
    itk.array_view_from_image(mask)[2:6, 3:8, 5:] = 1
    mask.Modified()
    mip.Update()
    expected, _ = oracle.project_rays(image, oblique_view, mip.GetOutput(), Rule(mask_image=mask))
    assert_array_equal(mip.GetOutput(), expected)


def test_errors_of_the_physical_point(image, oblique_view):
    mip = itk.ShearWarpMIPImageFilter.New(image, Transform=oblique_view, ComputeDepth=True)
    mip.Update()
    with pytest.raises(RuntimeError, match="no depth at index"):
        mip.GetPhysicalPoint([1000, 0])
    with pytest.raises(RuntimeError, match="No ray has a value"):
        mip.GetPhysicalPoint([0, 0])
    width, height = itk.size(mip.GetOutput())
    assert len(mip.GetPhysicalPoint([width // 2, height // 2])) == 3
