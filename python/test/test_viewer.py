"""The viewer on a canvas that nobody sees: state, pictures, points, gestures and keys."""

import gc
import itertools
import sys
import threading
import time
import weakref
from types import SimpleNamespace

import itk
import numpy as np
import pytest
import xarray
from itk_shearwarpmip import Point, Viewer, _scene, _server, _viewer, mip, show
from numpy.testing import assert_array_equal
from PIL import Image
from rendercanvas.offscreen import RenderCanvas
from samples import make_image, make_like

SIZE = 120, 90


@pytest.fixture
def open_viewer():
    opened = []

    def open_one(source, **parameters) -> Viewer:
        viewer = show(source, canvas=RenderCanvas(size=SIZE), **parameters)
        opened.append(viewer)
        return viewer

    yield open_one
    for viewer in opened:
        viewer.close()


@pytest.fixture
def viewer(open_viewer, image):
    return open_viewer(image)


def send(viewer, kind, x=0.0, y=0.0, button=1, modifiers=(), **more):
    viewer._handle({"event_type": kind, "x": x, "y": y, "button": button, "modifiers": modifiers, **more})


def press(viewer, *keys):
    for key in keys:
        send(viewer, "key_down", key=key)


def drag(viewer, right, down, start=(60.0, 45.0), **how):
    x, y = start
    send(viewer, "pointer_down", x, y, **how)
    for part in (0.25, 0.5, 0.75, 1):
        send(viewer, "pointer_move", x + part * right, y + part * down, **how)
    send(viewer, "pointer_up", x + right, y + down, **how)


def click(viewer, x, y):
    send(viewer, "pointer_down", x, y)
    send(viewer, "pointer_up", x, y)


def find_pixel(viewer, place, size=SIZE):
    """Column and row where a place of the patient is seen."""
    u, v, _ = viewer.transform.GetInverseTransform().TransformPoint(list(place))
    grid = viewer._scene.make_grid(viewer._state, size)
    return [(each - first) / grid.spacing for each, first in zip((u, v), grid.origin)]


def wait(condition, seconds=20):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)


def drawn(viewer):
    """What the canvas has at rest."""
    viewer.canvas.draw()
    viewer._settle()
    return viewer.canvas.draw()


def evaluate_code(viewer, image):
    return np.asarray(eval(viewer.code, {"mip": mip, "image": image}))


def make_grey(values, window):
    low, high = window
    return np.floor(255 * ((np.clip(values.astype(float), low, high) - low) / (high - low)) + 0.5).astype(np.uint8)


def project(image, view="anterior", azimuth=0.0, elevation=0.0, mode="maximum", slab=(-np.inf, np.inf), **settings):
    """What mip() does, by the filter."""
    if isinstance(view, list):
        transform = itk.AffineTransform[itk.D, 3].New()
        transform.SetMatrix(itk.matrix_from_array(np.array(view)[:3, :3].copy()))
        transform.SetOffset(np.array(view)[:3, 3].tolist())
    else:
        side = getattr(itk.ShearWarpMIPViewEnums, f"Direction_{view.capitalize()}")
        transform = itk.ShearWarpMIPView.MakeTransform(image, side, azimuth, elevation)
    mode = "AbsoluteMaximum" if mode == "absolute_maximum" else mode.capitalize()
    settings |= {"mode": getattr(itk.ShearWarpMIPImageFilterEnums, f"Mode_{mode}"), "transform": transform}
    settings |= {"slab_near": slab[0], "slab_far": slab[1]}
    lowest = min(0, itk.array_view_from_image(image).min().item())
    settings["default_pixel_value"] = settings.pop("background", lowest)
    return itk.array_from_image(itk.shear_warp_mip_image_filter(image, **settings))


def expected(viewer, image):
    """The picture at rest without text, by the viewer's own line of Python."""
    code, _, window = viewer.code.partition("  # window ")
    low, high = window.split(" to ")
    assert (float(low), float(high)) == pytest.approx(viewer.window, rel=1e-5)
    return make_grey(eval(code, {"mip": project, "image": image}), viewer.window)


def check_at_rest(viewer, image):
    if viewer._state.has_text:
        press(viewer, "v")
    found = drawn(viewer)
    assert found.shape == (SIZE[1], SIZE[0], 4) and (found[..., 3] == 255).all()
    assert_array_equal(found[..., :3], np.dstack([expected(viewer, image)] * 3))
    return found


# ---- The picture at rest


@pytest.mark.parametrize("type_", [np.uint8, np.int16, np.uint16, np.float32, np.float64])
def test_picture_at_rest_is_that_of_the_filter(type_, image, rng, open_viewer):
    voxels = rng.integers(0 if np.dtype(type_).kind == "u" else -1000, 250, (9, 11, 14)).astype(type_)
    typed = make_like(voxels, image)
    viewer = open_viewer(typed, azimuth=30, elevation=-10)
    assert "azimuth=30.0, elevation=-10.0" in viewer.code
    first = check_at_rest(viewer, typed)
    drag(viewer, 37, -12)
    assert (check_at_rest(viewer, typed) != first).any()
    viewer.window = (-20, 177.5)
    check_at_rest(viewer, typed)
    viewer.slab = (-3.0, 2.5)
    viewer.mode = "minimum"
    check_at_rest(viewer, typed)


@pytest.mark.parametrize("keys", ["", "t", "s", "si", "tl", "]-[", "m", "mm"])
def test_code_makes_the_picture(keys, image, viewer):
    """After turns, views, slabs and modes: the same bits."""
    press(viewer, *keys)
    drag(viewer, 21, 17)
    send(viewer, "wheel", 20, 70, dy=-100)
    drag(viewer, 9, -5, button=3)
    check_at_rest(viewer, image)


def test_exact_picture_at_rest(image, open_viewer):
    viewer, plain = open_viewer(image, exact=True, azimuth=20), open_viewer(image, azimuth=20)
    assert "exact=True" in viewer.code
    drag(viewer, 15, 8)
    drag(plain, 15, 8)
    assert (check_at_rest(viewer, image) != check_at_rest(plain, image)).any()
    # in motion it is plain
    assert_array_equal(
        viewer._scene.paint(viewer._state, SIZE, factor=2), plain._scene.paint(plain._state, SIZE, factor=2)
    )


def test_command_says_what_the_code_says(image, tmp_path, open_viewer):
    itk.imwrite(image, tmp_path / "an image.nrrd")
    viewer = open_viewer(tmp_path / "an image.nrrd", azimuth=12.5, window=(0, 50), mode="minimum", slab=(-1, 2))
    words = viewer.command
    assert words.startswith(
        f"shear-warp-mip '{tmp_path}/an image.nrrd' mip.png --azimuth 12.5 --mode minimum --slab -1.0 2.0 "
    )
    assert "--size 120 90" in words and words.endswith("--window 0.0 50.0")
    press(viewer, "p", "m")
    assert "--view posterior --mode absolute-maximum" in viewer.command
    with pytest.raises(ValueError, match="no command"):
        print(open_viewer(tmp_path / "an image.nrrd", background=5).command)
    drag(viewer, 10, 0, button=3)
    with pytest.raises(ValueError, match="no command alone makes this picture"):
        print(viewer.command)


def test_line_is_told(viewer, capsys):
    press(viewer, "c")
    assert capsys.readouterr().out == viewer.code + "\n"
    assert "copied" in viewer._state.message
    press(viewer, "C")
    assert capsys.readouterr().out == "" and viewer._state.message.startswith("No command alone")


def test_window_is_that_of_the_program(image, viewer):
    """Percentiles 1 and 99.8 of the pixels that are not background, of the picture that is fitted to the image."""
    pixels = project(image)
    pixels = np.sort(pixels[pixels != itk.array_view_from_image(image).min()])
    assert viewer.window == tuple(pixels[[round(part * (pixels.size - 1)) for part in (0.01, 0.998)]])


def test_lower_resolution(image, viewer):
    """A coarse pixel is at the middle of the fine pixels that it stands for, also where they do not fit."""
    view, size = viewer._state, (25, 14)
    fine = viewer._scene.make_grid(view, size)
    coarse = fine.coarsen(3)
    assert coarse.size == (9, 5) and coarse.spacing == 3 * fine.spacing
    assert coarse.origin == pytest.approx([first + fine.spacing for first in fine.origin])
    press(viewer, "v")
    viewer._settle()
    painted, window = viewer._scene.paint(viewer._state, size, factor=3), viewer.window
    assert painted.shape == (14, 25, 4)
    values = viewer._scene.layers[0].project(view, coarse)
    assert_array_equal(painted[1::3, 1::3, 0], make_grey(values, window)[: painted[1::3].shape[0], :8])
    assert_array_equal(painted[0], painted[2])


# ---- Two volumes


@pytest.fixture
def two(image, rng):
    """A second volume on another grid in the same space."""
    return image, make_image(rng.random((7, 8, 9), np.float32), (1.4, 1.1, 2.0), (13.0, -29.0, 6.0))


def test_overlay_is_blended(two, open_viewer):
    viewer = open_viewer(
        two[0], overlay=two[1], overlay_window=(0.5, 1.0), opacity=0.8, azimuth=25, elevation=5, overlay_colour="jet"
    )
    press(viewer, "v")
    assert viewer.overlay_window == (0.5, 1.0)
    found = drawn(viewer)
    matrix = repr(_scene.get_matrix(viewer.transform).tolist())
    code = viewer.code.partition("  #")[0].replace("azimuth=25.0, elevation=5.0", f"view={matrix}")
    greys = [
        make_grey(eval(code, {"mip": project, "image": volume}), window)
        for volume, window in zip(two, (viewer.window, viewer.overlay_window))
    ]
    jet = itk.ScalarToRGBColormapImageFilterEnums.RGBColormapFilter_Jet
    levels = itk.image_from_array(np.arange(256, dtype=np.uint8)[None])
    table = itk.array_from_image(itk.scalar_to_rgb_colormap_image_filter(levels, colormap=jet))[0]
    assert greys[1].max() > 200 and (greys[1] == 0).any()
    part = 0.8 * greys[1][..., None] / 255
    wanted = greys[0][..., None] + (table[greys[1]].astype(float) - greys[0][..., None]) * part
    assert np.abs(found[..., :3] - wanted).max() <= 0.5 + 1e-9
    # where the second volume is black, the first one is as it is by itself
    assert_array_equal(found[greys[1] == 0][..., 0], greys[0][greys[1] == 0])


def test_overlay_is_cropped_with_the_volume(two, open_viewer):
    view = _scene.get_matrix(_scene.make_view(two[0], "left", 10, 20))
    # no view by its name, which has another center in each volume
    view[0, 3] += 1
    viewer = open_viewer(two[0], overlay=two[1], view=view, crop=[(14, -28, 8), (18, -24, np.inf)])
    for picture, volume in zip(viewer.project(), two):
        assert_array_equal(picture, evaluate_code(viewer, volume))


def test_overlay_that_is_an_array_lies_where_the_volume_does(image, rng, open_viewer):
    region = image.GetLargestPossibleRegion()
    region.SetIndex([3, -2, 5])
    image.SetRegions(region)
    voxels = rng.random((9, 11, 14), np.float32)
    origin, direction = image.TransformIndexToPhysicalPoint([3, -2, 5]), itk.array_from_matrix(image.GetDirection())
    placed = make_image(voxels, image.GetSpacing(), origin, direction)
    found, wanted = (open_viewer(image, overlay=each, azimuth=20, overlay_window=(0, 1)) for each in (voxels, placed))
    assert_array_equal(found.snapshot(), wanted.snapshot())
    indices = [each.pick(60, 45).overlay.index for each in (found, wanted)]
    assert np.subtract(*indices).tolist() == [3, -2, 5]
    with pytest.raises(
        ValueError, match=r"must have the shape of the volume, \(9, 11, 14\), .*: give overlay=open_image"
    ):
        open_viewer(image, overlay=voxels[1:])


def test_windows_of_two_volumes(two, open_viewer):
    viewer = open_viewer(two[0], overlay=two[1])
    first, second = viewer.window, viewer.overlay_window
    drag(viewer, 30, 0, button=2)
    assert viewer.overlay_window == second and viewer.window != first
    press(viewer, "o")
    changed = viewer.window
    drag(viewer, 30, 0, button=2)
    assert viewer.window == changed and viewer.overlay_window != second
    press(viewer, "o")
    changed = viewer.overlay_window
    drag(viewer, 30, 0, button=2)
    assert viewer.overlay_window == changed
    viewer.overlay_window = (0.25, 0.5)
    assert viewer.overlay_window == (0.25, 0.5)
    viewer.overlay_window = None
    assert viewer.overlay_window == second


def test_point_of_two_volumes(two, open_viewer):
    viewer = open_viewer(two[0], overlay=two[1], azimuth=25)
    point = viewer.pick(60, 45)
    assert viewer.point == point and point.overlay is not None and point.overlay.overlay is None
    pictures = viewer.project()
    for each, picture in zip((point, point.overlay), pictures):
        assert each.value == pytest.approx(picture.GetPixel([60, 45]))
    for each, volume in zip((point, point.overlay), two):
        assert tuple(volume.TransformPhysicalPointToIndex(each.position)) == each.index


# ---- Letters and numbers


@pytest.mark.parametrize(
    "view, letters",
    [
        ("anterior", "RLHF"),
        ("posterior", "LRHF"),
        ("left", "APHF"),
        ("right", "PAHF"),
        ("superior", "LRAP"),
        ("inferior", "RLAP"),
    ],
)
def test_letters(view, letters, image, open_viewer, monkeypatch):
    """Left, right, top and bottom of the picture."""
    viewer = open_viewer(image)
    press(viewer, view[0])
    placed = record_stamps(viewer, monkeypatch)
    width, height = SIZE
    found = {}
    for text, (x, y, right, bottom) in placed.items():
        if len(text) == 1:
            found[(right, bottom)] = text
            assert 0 <= x <= width and 0 <= y <= height
    assert [found[place] for place in ((0.0, 0.5), (1.0, 0.5), (0.5, 0.0), (0.5, 1.0))] == list(letters)
    assert view.capitalize() in placed


def record_stamps(viewer, monkeypatch):
    # no other picture is made meanwhile
    viewer._settle()
    texts, placed = {}, {}
    make, put = _scene._make_stamp, _scene._put

    def make_stamp(text, size, colour):
        stamp = make(text, size, colour)
        texts[id(stamp)] = text
        return stamp

    def put_stamp(rgba, stamp, *place):
        if id(stamp) in texts:
            placed[texts[id(stamp)]] = place
        put(rgba, stamp, *place)

    with monkeypatch.context() as patch:
        patch.setattr(_scene, "_make_stamp", make_stamp)
        patch.setattr(_scene, "_put", put_stamp)
        viewer._scene.paint(viewer._state, SIZE)
    return placed


def test_texts_of_the_picture(image, tmp_path, open_viewer, monkeypatch):
    itk.imwrite(image, tmp_path / "head.nrrd")
    viewer = open_viewer(tmp_path / "head.nrrd", azimuth=30, elevation=-10, window=(100, 300))
    point = viewer.pick(60, 45)
    placed = record_stamps(viewer, monkeypatch)
    (x, y, z), (i, j, k) = point.position, point.index
    assert x > 0 > y and z > 0
    for text in (f"{point.value}", f"L {x:.1f}  A {-y:.1f}  H {z:.1f} mm", f"voxel {i}, {j}, {k}", "W 200  L 200"):
        assert text in placed
    assert not any("head" in text for text in placed) and "LAO 30°  CAU 10°" in placed and "Minimum" not in placed
    viewer = open_viewer(tmp_path / "head.nrrd", title="Case 3")
    assert "Case 3" in record_stamps(viewer, monkeypatch)
    viewer.transform, viewer.mode = _scene.make_view(image, "anterior", -30.5, 10), "minimum"
    assert {"RAO 30.5°  CRA 10°", "Minimum"} <= set(record_stamps(viewer, monkeypatch))


def test_an_array_has_no_letters_and_micrometres_are_said(rng, open_viewer, monkeypatch):
    source = xarray.DataArray(
        rng.integers(0, 99, (9, 11, 14)), {axis: np.arange(n) for axis, n in zip("zyx", (9, 11, 14))}
    )
    for axis in "xyz":
        source[axis].attrs["units"] = "micrometer"
    viewer = open_viewer(source, slab=(-4, 5))
    viewer.canvas.set_logical_size(480, 360)
    viewer.canvas.draw()
    x, y, z = viewer.pick(240, 180).position
    placed = record_stamps(viewer, monkeypatch)
    assert not {"R", "L", "H", "F"} & set(placed)
    assert "Slab 9.0 µm at 0.5 µm" in placed
    assert f"x {x:.1f}  y {y:.1f}  z {z:.1f} µm" in placed
    assert {"2 µm", "5 µm"} & set(placed)


@pytest.mark.parametrize("azimuth", [-170, -90, -35, 0, 20, 90, 180])
@pytest.mark.parametrize("elevation", [-90, -60, 0, 15, 90])
def test_angles_are_those_of_the_view(azimuth, elevation, image):
    transform = _scene.make_view(image, "anterior", azimuth, elevation)
    found = _scene.find_angles(transform)
    again = _scene.make_view(image, "anterior", *found[:2])
    np.testing.assert_allclose(_scene.get_matrix(again), _scene.get_matrix(transform), rtol=0, atol=1e-9)
    assert found[2] == pytest.approx(0, abs=1e-6)


def test_scale_bar_is_as_long_as_it_says(viewer, monkeypatch):
    lengths = []
    make = _scene._make_bar
    monkeypatch.setattr(_scene, "_make_bar", lambda length, scale: lengths.append(length) or make(length, scale))
    send(viewer, "wheel", 60, 45, dy=-150)
    placed = record_stamps(viewer, monkeypatch)
    millimetres = next(float(text.split()[0]) for text in placed if text.endswith(" mm"))
    assert lengths[-1] == round(millimetres / viewer._scene.make_grid(viewer._state, SIZE).spacing)
    assert str(millimetres).lstrip("0.")[0] in "125"


def test_text_at_the_rim_is_cut():
    rgba = np.zeros((6, 5, 4), np.uint8)
    stamp = _scene._make_stamp("W", 14.0, "#ffffff")
    for x, y in itertools.product((-40, -3, 2, 4, 50), repeat=2):
        _scene._put(rgba, stamp, x, y, 0.5, 0.5)
    assert rgba.any()


# ---- Points


@pytest.mark.parametrize(
    "azimuth, elevation, exact", [(0, 0, False), (35, 20, False), (-120, -40, False), (35, 20, True)]
)
def test_point_of_a_bright_voxel(azimuth, elevation, exact, image, open_viewer):
    voxels = itk.array_view_from_image(image)
    voxels[:] = 0
    voxels[5, 3, 9] = 1000
    viewer = open_viewer(image, azimuth=azimuth, elevation=elevation, exact=exact)
    picked = []
    assert viewer.on_pick(picked.append)
    place = np.array(list(image.TransformIndexToPhysicalPoint([9, 3, 5])))
    x, y = (each + 0.5 for each in find_pixel(viewer, place))
    click(viewer, x, y)
    wait(lambda: picked)
    point = viewer.point
    assert picked == [point] and isinstance(point, Point) and point.overlay is None
    assert point.index == (9, 3, 5)
    assert point.value == viewer.project().GetPixel([int(x), int(y)]) > 200
    # within the pixel and the distance of slices
    assert np.linalg.norm(np.array(point.position) - place) < 1.1
    assert find_pixel(viewer, point.position) == pytest.approx([int(x), int(y)], rel=1e-8)


def test_cross_follows_its_point(image, viewer):
    viewer.canvas.set_logical_size(480, 360)
    point = viewer.pick(240, 180)
    for keys in ("", "l", "s"):
        press(viewer, *keys)
        with_cross = drawn(viewer)
        viewer._change(point=None)
        rows, columns = np.nonzero((with_cross != drawn(viewer)).any(-1))
        viewer._change(point=point)
        x, y = find_pixel(viewer, point.position, (480, 360))
        near = (abs(rows - y) < 20) & (abs(columns - x) < 20)
        assert near.sum() > 20
        assert [rows[near].mean(), columns[near].mean()] == pytest.approx([y, x], abs=1.5)


def test_click_beside_the_image(viewer):
    picked = []
    viewer.on_pick(picked.append)
    viewer.pick(60, 45)
    click(viewer, 1, 1)
    wait(lambda: viewer.point is None)
    assert not picked


def test_failing_callback_is_told_and_the_others_are_called(viewer, caplog):
    picked = []
    viewer.on_pick(lambda point: 1 / 0)
    viewer.on_pick(picked.append)
    click(viewer, 60, 45)
    wait(lambda: picked)
    assert "ZeroDivisionError" in caplog.text
    drawn(viewer)


# ---- Gestures and keys


def test_drag_turns_about_the_long_axis(viewer):
    """By 180 degrees along the shorter side; what is in front follows the pointer."""
    drag(viewer, 45, 0)
    assert _scene.find_angles(viewer.transform) == pytest.approx((-90, 0, 0), abs=0.01)
    drag(viewer, 0, 9)
    assert _scene.find_angles(viewer.transform) == pytest.approx((-90, 18, 0), abs=0.01)
    drag(viewer, 0, 90)
    assert _scene.find_angles(viewer.transform)[1] == pytest.approx(90)


def mirror(viewer):
    viewer.transform = _scene.get_matrix(viewer.transform) @ np.diag([-1, 1, 1, 1])


@pytest.mark.parametrize("is_mirrored", [False, True])
def test_trackball(image, viewer, is_mirrored):
    press(viewer, "t")
    if is_mirrored:
        mirror(viewer)
    center = viewer._scene.center
    for right, down in ((5, 0), (0, 5), (4, -3)):
        axes = _scene.get_axes(viewer.transform)
        front = center - axes[:, 2]
        drag(viewer, right, down)
        turned = _scene.get_axes(viewer.transform)
        # the way gives the angle, and the point in front goes where the pointer goes
        angle = np.degrees(np.arccos(np.clip((np.trace(axes.T @ turned) - 1) / 2, -1, 1)))
        assert angle == pytest.approx(180 / 90 * np.hypot(right, down), rel=1e-6)
        moved = turned.T @ (front - center)
        assert moved[:2] / np.linalg.norm(moved[:2]) == pytest.approx(np.array([right, down]) / np.hypot(right, down))
        np.testing.assert_allclose(viewer.transform.TransformPoint([0.0, 0.0, 0.0]), center, atol=1e-9)
    assert abs(_scene.find_angles(viewer.transform)[2]) > 0.1


def test_turn_about_the_long_axis_of_any_view(image, viewer):
    """A rolled view keeps its roll with horizontal drags, and is turned about the patient's axis."""
    view = _scene.make_view(image, "anterior", 30, 20)
    viewer.transform = itk.ShearWarpMIPView.Turn(
        view, _scene.get_axes(view)[:, 2].tolist(), viewer._scene.center.tolist(), 25.0
    )
    assert _scene.find_angles(viewer.transform) == pytest.approx((30, 20, 25))
    drag(viewer, 20, 0)
    assert _scene.find_angles(viewer.transform) == pytest.approx((-10, 20, 25), abs=0.01)
    drag(viewer, 0, 5)
    assert _scene.find_angles(viewer.transform)[1] > 25


def test_mirrored_view(viewer, monkeypatch):
    """Has no roll, says so, and its front follows the pointer."""
    mirror(viewer)
    assert "Anterior  mirrored" in record_stamps(viewer, monkeypatch)
    drag(viewer, 15, 0)
    drag(viewer, 0, 5)
    assert _scene.find_angles(viewer.transform) == pytest.approx((30, 10, 0), abs=0.01)
    assert "LAO 30°  CRA 10°  mirrored" in record_stamps(viewer, monkeypatch)


@pytest.mark.parametrize("zero", [0.0, -0.0, 1e-17, -1e-17])
def test_half_turn_is_positive(zero, image):
    from_above = [[-1, zero, 0, 0], [zero, 1, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]]
    assert _scene.find_angles(_scene.make_view(image, from_above)) == (180, 90, 0)


def test_small_angle_has_a_name(viewer, monkeypatch):
    viewer.transform = _scene.make_view(viewer._image, "anterior", 0.04, 0)
    assert "Anterior" in record_stamps(viewer, monkeypatch)


def test_arrow_keys(viewer):
    press(viewer, "ArrowLeft", "ArrowLeft", "ArrowDown")
    assert _scene.find_angles(viewer.transform) == (10, 5, 0)
    press(viewer, "ArrowRight", "ArrowUp")
    assert _scene.find_angles(viewer.transform) == (5, 0, 0)


def test_keys_with_control_are_the_browsers(viewer):
    before = viewer._state
    send(viewer, "key_down", key="p", modifiers=("Control",))
    press(viewer, "F5", "Tab", "x")
    assert viewer._state is before


def test_a_drag_ends_with_its_page(viewer):
    """The hand of the next page holds no button."""
    send(viewer, "pointer_down", 60, 45)
    send(viewer, "pointer_move", 70, 45, buttons=(1,))
    turned = viewer.transform
    send(viewer, "pointer_move", 20, 30, buttons=())
    send(viewer, "pointer_move", 30, 40, buttons=())
    assert viewer.transform is turned and viewer._drag is None
    viewer._settle()
    assert_array_equal(viewer.canvas.draw(), viewer.snapshot())


def test_window_by_drag(image, viewer):
    low, high = viewer.window
    drag(viewer, 150, 0, button=2)
    assert viewer.window[1] - viewer.window[0] == pytest.approx(2 * (high - low))
    assert sum(viewer.window) == pytest.approx(low + high)
    low, high = viewer.window
    drag(viewer, 0, -30, button=2)
    assert sum(viewer.window) / 2 < (low + high) / 2
    assert viewer.window[1] - viewer.window[0] == pytest.approx(high - low)
    check_at_rest(viewer, image)
    viewer.window = low, high + 200
    check_at_rest(viewer, image)


def test_pan(viewer):
    grid = viewer._scene.make_grid(viewer._state, SIZE)
    for how in ({"button": 3}, {"button": 1, "modifiers": ("Shift",)}):
        before = viewer._state.pan
        drag(viewer, 10, -4, **how)
        assert viewer._state.pan == pytest.approx((before[0] - 10 * grid.spacing, before[1] + 4 * grid.spacing))


def test_zoom_keeps_what_is_under_the_pointer(viewer):
    def find(x, y):
        grid = viewer._scene.make_grid(viewer._state, SIZE)
        return [first + (place - 0.5) * grid.spacing for first, place in zip(grid.origin, (x, y))]

    before = find(30, 70)
    send(viewer, "wheel", 30, 70, dy=-300)
    assert viewer._state.zoom == pytest.approx(2)
    assert find(30, 70) == pytest.approx(before, abs=viewer._scene.make_grid(viewer._state, SIZE).spacing)
    for _ in range(100):
        send(viewer, "wheel", 30, 70, dy=300)
    assert viewer._state.zoom == 0.1
    send(viewer, "wheel", 20, 70, dy=-1e6)
    assert viewer._state.zoom == 100


def test_slab(image, viewer):
    reach = max(np.linalg.norm(corner) for corner in viewer._scene.extent)
    press(viewer, "[")
    assert viewer.slab is None and "no slab" in viewer._state.message
    press(viewer, "+")
    assert viewer.slab is None
    press(viewer, "-")
    assert viewer.slab == pytest.approx((-0.8 * reach, 0.8 * reach))
    press(viewer, "]")
    assert viewer.slab == pytest.approx((-0.4 * reach, 1.2 * reach))
    press(viewer, "[", "+", "+")
    assert viewer.slab is None
    press(viewer, *"-" * 40)
    assert viewer.slab[1] - viewer.slab[0] == pytest.approx(min(image.GetSpacing()))


def test_modes(viewer):
    windows = {}
    for mode in ("maximum", "minimum", "absolute_maximum", "mean"):
        assert viewer.mode == mode
        windows[mode] = viewer.window
        press(viewer, "m")
    assert viewer.mode == "maximum" and len(set(windows.values())) == 4
    viewer.window = 0, 1
    press(viewer, "m")
    assert viewer.window == windows["minimum"]
    press(viewer, "m", "m", "m")
    assert viewer.window == (0, 1)


def test_a_mean_has_no_point_and_is_not_exact(image, open_viewer):
    viewer = open_viewer(image, mode="mean")
    assert viewer.pick(SIZE[0] // 2, SIZE[1] // 2) is None
    check_at_rest(viewer, image)
    exact = open_viewer(image, exact=True)
    press(exact, "m", "m", "m")
    assert exact.mode == "maximum"
    with pytest.raises(ValueError, match="mode 'mean' is not possible"):
        exact.mode = "mean"


def test_modes_are_those_that_parameters_allow(image, open_viewer):
    viewer = open_viewer(image, local_maximum=5)
    press(viewer, "m")
    assert viewer.mode == "minimum"
    press(viewer, "m")
    assert viewer.mode == "maximum"
    with pytest.raises(ValueError, match=r"mode 'absolute_maximum' is not possible .* local_maximum"):
        viewer.mode = "absolute_maximum"


def test_double_click_resets(image, open_viewer, monkeypatch):
    monkeypatch.setattr(_viewer, "_DOUBLE_CLICK_SECONDS", 1000)
    viewer = open_viewer(image, view="left", window=(0, 500), slab=(-2, 2))
    before = drawn(viewer)
    picked = []
    viewer.on_pick(picked.append)
    drag(viewer, 30, 10)
    drag(viewer, 30, 10, button=2)
    drag(viewer, 10, 5, button=3)
    press(viewer, "m", "+")
    send(viewer, "wheel", 3, 4, dy=-80)
    assert (drawn(viewer) != before).any()
    for _ in range(2):
        click(viewer, 60, 45)
        wait(lambda: picked and not viewer._jobs)
        viewer._settle()
    send(viewer, "double_click", 60, 45)
    assert_array_equal(drawn(viewer), before)
    assert len(picked) == 1 and viewer.point is None
    assert (viewer.slab, viewer.window, viewer.mode) == ((-2, 2), (0, 500), "maximum")
    # but not what is written
    press(viewer, "v")
    send(viewer, "double_click", 60, 45)
    assert not viewer._state.has_text


def test_point_that_is_found_after_a_reset_is_none(viewer, monkeypatch):
    """The first click of a double click, on a slow machine."""
    picked, find = [], viewer._scene.find_point
    viewer.on_pick(picked.append)
    begun, go_on = threading.Event(), threading.Event()

    def find_slowly(*arguments):
        begun.set()
        assert go_on.wait(20)
        return find(*arguments)

    monkeypatch.setattr(viewer._scene, "find_point", find_slowly)
    click(viewer, 60, 45)
    assert begun.wait(20)
    send(viewer, "double_click", 60, 45)
    go_on.set()
    viewer._settle()
    assert viewer.point is None and not picked


def test_help(viewer):
    before = drawn(viewer)
    press(viewer, "?")
    assert (drawn(viewer) != before).mean() > 0.3
    press(viewer, "?")
    assert_array_equal(drawn(viewer), before)
    viewer.pick(60, 45)
    press(viewer, "?", "Escape")
    assert viewer.point is None and not viewer._state.has_help


def test_every_key_of_the_help_does_something(viewer):
    """What the help lists is what there is."""
    keys = " ".join(keys for keys, _ in _scene.HELP)
    for name in ("A P L R S I", "Space", "T", "M", "O", "V", "C", "?", "Arrow", "+", "-", "[", "]"):
        assert name in keys
    for key in ["a", "p", "l", "r", "s", "i", " ", "t", "m", "o", "v", "c", "?", "+", "-", "[", "]"]:
        before = viewer._state, viewer._played_from, viewer.turns_about_axis
        press(viewer, key)
        assert (viewer._state, viewer._played_from, viewer.turns_about_axis) != before, key


# ---- In motion


def test_turn_plays_and_stops(viewer):
    viewer.canvas.draw()
    press(viewer, " ")
    angles = set()
    end = time.monotonic() + 10
    while len(angles) < 5 and time.monotonic() < end:
        viewer.canvas.draw()
        angles.add(_scene.find_angles(viewer.transform)[0])
        time.sleep(0.02)
    assert len(angles) >= 5
    press(viewer, " ")
    stopped = viewer.transform
    press(viewer, "v")
    wait(lambda: viewer._worker is None)
    assert viewer.transform is stopped
    assert_array_equal(viewer.canvas.draw(), viewer.snapshot())


def test_turn_of_eight_seconds_goes_as_turn_does(viewer, monkeypatch):
    viewer._settle()
    monkeypatch.setattr(_viewer, "time", SimpleNamespace(monotonic=lambda: 2.0))
    viewer._played_from = 0.0, viewer._state
    viewer._play(viewer._state)
    viewer._played_from = None
    assert _scene.find_angles(viewer.transform)[0] == pytest.approx(90)


def test_stale_requests_are_dropped(viewer, monkeypatch):
    """A slow picture: of a hundred movements a few are shown, and the last one."""
    painted = []
    paint = viewer._scene.paint

    def paint_slowly(state, size, **how):
        painted.append((state, how["factor"]))
        time.sleep(0.05)
        return paint(state, size, **how)

    drawn(viewer)
    monkeypatch.setattr(viewer._scene, "paint", paint_slowly)
    send(viewer, "pointer_down", 10, 45)
    start = time.monotonic()
    for n in range(100):
        send(viewer, "pointer_move", 10 + n, 45)
        viewer.canvas.draw()
        time.sleep(0.002)
    send(viewer, "pointer_up", 109, 45)
    most = 3 + (time.monotonic() - start) / 0.05
    last = viewer._state
    viewer._settle()
    assert 2 <= len(painted) <= most
    assert painted[-1] == (last, 1)
    monkeypatch.undo()
    assert_array_equal(viewer.canvas.draw(), viewer.snapshot())


def test_resolution_falls_when_pictures_are_slow(viewer, monkeypatch):
    paint = viewer._scene.paint

    def paint_slowly(state, size, *, factor, **options):
        time.sleep(slow / factor**2)
        rgba = paint(state, size, factor=factor, **options)
        viewer._scene.paint_seconds = slow / factor**2
        factors.append(factor)
        return rgba

    def move_until(condition):
        def move():
            send(viewer, "pointer_move", next(places), 45)
            viewer.canvas.draw()
            return condition()

        wait(move)

    factors, slow, places = [], 0.1, itertools.cycle(range(100))
    drawn(viewer)
    monkeypatch.setattr(viewer._scene, "paint", paint_slowly)
    send(viewer, "pointer_down", 10, 45)
    move_until(lambda: 2 in factors)
    assert factors[0] == 1
    viewer._settle()
    assert factors[-1] == 1 and viewer._factor > 1
    slow = 0
    move_until(lambda: viewer._factor == 1)


def test_canvas_that_takes_nothing_is_not_flooded(viewer, monkeypatch):
    """A hidden page: pictures wait for it."""
    drawn(viewer)
    painted = []
    paint = viewer._scene.paint
    monkeypatch.setattr(viewer._scene, "paint", lambda *a, **k: painted.append(1) or paint(*a, **k))
    send(viewer, "pointer_down", 10, 45)
    start = time.monotonic()
    for n in range(100):
        send(viewer, "pointer_move", 10 + n, 45)
        time.sleep(0.002)
    assert len(painted) <= 3 + (time.monotonic() - start) / _viewer._CANVAS_SECONDS


def test_exact_picture_is_given_up_when_the_hand_moves(open_viewer, rng, monkeypatch, caplog):
    image = itk.image_from_array(rng.integers(0, 1000, (64, 64, 64), np.uint16))
    viewer = open_viewer(image, exact=True, azimuth=30, elevation=20)
    viewer.canvas.set_logical_size(600, 450)
    drawn(viewer)
    paint, ended, begun = viewer._scene.paint, [], threading.Event()

    def paint_and_note(*arguments, **how):
        begun.set()
        try:
            return paint(*arguments, **how)
        except RuntimeError as error:
            ended.append(error)
            raise

    monkeypatch.setattr(viewer._scene, "paint", paint_and_note)
    for n in range(50):
        begun.clear()
        viewer._change(True, zoom=1.0 + n / 100)
        assert begun.wait(20)
        time.sleep(0.005)
        if len(ended) > 2:
            break
    assert "aborted" in str(ended[0])
    viewer._settle()
    assert_array_equal(viewer.canvas.draw(), viewer.snapshot())
    assert not caplog.text


def test_resize(image, viewer):
    drawn(viewer)
    viewer.canvas.set_logical_size(64, 48)
    assert drawn(viewer).shape == (48, 64, 4)
    assert viewer.project().GetLargestPossibleRegion().GetSize() == (64, 48)


def test_pixel_ratio(image):
    """On a fine screen a drag turns as far, and a click means the pixel under it."""
    viewer = show(image, canvas=RenderCanvas(size=SIZE, pixel_ratio=2.0))
    assert drawn(viewer).shape == (180, 240, 4)
    drag(viewer, 45, 0)
    assert _scene.find_angles(viewer.transform)[0] == pytest.approx(-90, abs=0.01)
    picked = []
    viewer.on_pick(picked.append)
    click(viewer, 60, 45)
    wait(lambda: picked)
    assert picked[0].value == viewer.project().GetPixel([120, 90])

    def find(x, y):
        grid = viewer._scene.make_grid(viewer._state, (240, 180))
        return np.array([first + (2 * place - 0.5) * grid.spacing for first, place in zip(grid.origin, (x, y))])

    before = find(30, 70)
    drag(viewer, 10, -4, button=3)
    assert find(40, 66) == pytest.approx(before)
    send(viewer, "wheel", 40, 66, dy=-300)
    assert find(40, 66) == pytest.approx(before, abs=viewer._scene.make_grid(viewer._state, (240, 180)).spacing)
    viewer.close()


# ---- For scripts


@pytest.mark.parametrize(
    "modules, expected",
    [
        ({}, False),
        ({"IPython": SimpleNamespace(get_ipython=lambda: None)}, False),
        ({"IPython": SimpleNamespace(get_ipython=SimpleNamespace)}, False),
        ({"IPython": SimpleNamespace(get_ipython=lambda: SimpleNamespace(kernel=1))}, True),
        ({"marimo": SimpleNamespace(running_in_notebook=lambda: True)}, True),
        ({"marimo": SimpleNamespace(running_in_notebook=lambda: False)}, False),
    ],
    ids=["script", "plain", "terminal", "Jupyter", "marimo", "script with marimo"],
)
def test_notebooks_are_known(modules, expected, monkeypatch):
    for name in ("IPython", "marimo"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    for name, module in modules.items():
        monkeypatch.setitem(sys.modules, name, module)
    assert _viewer._is_notebook() is expected


def test_scripts_wait_and_shells_do_not(image, monkeypatch):
    found = []
    monkeypatch.setattr(_server, "serve", lambda make, *, block: found.append(block))
    monkeypatch.setattr(_viewer, "_is_notebook", lambda: False)
    show(image)
    show(image, block=False)
    monkeypatch.setattr(sys, "ps1", ">>> ", raising=False)
    show(image)
    show(image, block=True)
    assert found == [True, False, False, True]


def test_transform(image, viewer, oblique_view):
    for view in (oblique_view, _scene.get_matrix(oblique_view)):
        viewer.transform = view
        assert_array_equal(_scene.get_matrix(viewer.transform), _scene.get_matrix(oblique_view))
    viewer.transform = "left"
    assert "view='left'" in viewer.code
    check_at_rest(viewer, image)
    # nearly a view that has a name
    moved = _scene.get_matrix(viewer.transform)
    moved[0, 3] += 1e-3
    viewer.transform = moved
    assert "view=[[" in viewer.code


def test_snapshot(viewer, tmp_path):
    drawn(viewer)
    press(viewer, "?", "l")
    rgba = viewer.snapshot(tmp_path / "x.png")
    assert_array_equal(Image.open(tmp_path / "x.png"), rgba[..., :3])
    assert (viewer.snapshot(text=False) != rgba).any()
    press(viewer, "?")
    assert_array_equal(drawn(viewer), rgba)
    with pytest.raises(OSError):
        viewer.snapshot(tmp_path / "none" / "x.png")


def test_parameters_of_the_filter(image, open_viewer):
    center = itk.ShearWarpMIPView.GetCenter(image)
    crop = [(center[0] - 2, -np.inf, -np.inf), (center[0] + 2, np.inf, np.inf)]
    viewer, whole = (open_viewer(image, azimuth=10, window=(0, 900), crop=each) for each in (crop, None))
    assert (drawn(viewer) != drawn(whole)).any()
    assert evaluate_code(viewer, image).tobytes() == np.asarray(viewer.project()).tobytes()
    mask = make_like(np.zeros((9, 11, 14), np.uint8), image)
    with pytest.warns(UserWarning, match="no voxel is in the mask"):
        masked = open_viewer(image, mask=mask, window=(0, 900), background=0)
    press(masked, "v")
    assert not drawn(masked)[..., :3].any() and "mask=mask, background=0" in masked.code


@pytest.mark.parametrize(
    "parameters, error, text",
    [
        ({"source": 3}, TypeError, "a volume is the path of an image"),
        ({"source": "/none.nrrd"}, FileNotFoundError, "none.nrrd"),
        ({"view": "front"}, ValueError, "view must be one of anterior"),
        ({"view": np.eye(3)}, ValueError, "must be 4 x 4"),
        ({"view": np.eye(4), "azimuth": 3}, ValueError, "are for a view that is a name"),
        ({"view": itk.BSplineTransform[itk.D, 3, 3].New()}, ValueError, "must be a linear transform"),
        ({"mode": "median"}, ValueError, "mode must be one of maximum, minimum"),
        ({"mode": ["maximum"]}, ValueError, "mode must be one of maximum, minimum"),
        ({"window": (3, 3)}, ValueError, "the lower one first"),
        ({"window": (3, np.inf)}, ValueError, "the lower one first"),
        ({"slab": (3, 2)}, ValueError, "near <= far"),
        ({"size": (0, 400)}, ValueError, "size must be positive"),
        ({"canvas": 3}, TypeError, "canvas must be one of rendercanvas, but it is 3"),
        ({"title": 3}, TypeError, "title must be a text, but it is 3"),
        ({"page": {"hots": 1}}, TypeError, "page must be a dictionary of host, port and no_browser, but it is"),
        ({"size": "large"}, ValueError, "size must be two whole numbers"),
        ({"colour": "grayish"}, ValueError, "colour must be one of"),
        ({"colour": ["hot"]}, ValueError, "colour must be one of"),
        ({"slab": (np.inf, np.inf)}, ValueError, "near <= far"),
        ({"opacity": 2}, ValueError, "opacity must be 0 to 1"),
        ({"opacity": "half"}, ValueError, "opacity must be 0 to 1, but it is 'half'"),
        ({"source": "cells.ome.zarr"}, ValueError, "cells.ome.zarr is no OME-Zarr"),
        ({"crop": [0, 1]}, ValueError, "crop must be two corners"),
        ({"page": 5}, TypeError, "page must be a dictionary of host, port and no_browser, but it is 5"),
        ({"exact": True, "oversampling": 2}, ValueError, "exact pictures have no mask"),
        ({"attenuation": -1}, ValueError, "attenuation must be finite and not negative"),
        ({"crop": [(5, 5, 5), (1, 1, 1)]}, ValueError, "crop's lower must not be greater"),
        ({"view": np.diag([1e200, 1, 1, 1])}, ValueError, "view must be invertible"),
        ({"color": "hot"}, TypeError, "color"),
        ({"windw": (0, 1)}, TypeError, "no parameter windw: did you mean window[?]"),
        ({"block": "x"}, ValueError, "block must be True or False, but it is 'x'"),
    ],
    ids=lambda value: str(value)[:20] if isinstance(value, dict) else "",
)
def test_bad_parameters(parameters, error, text, image):
    with pytest.raises(error, match=text):
        show(**{"source": image, "canvas": RenderCanvas(size=SIZE), **parameters})


@pytest.mark.parametrize(
    "name, values",
    [
        ("mode", ["median"]),
        ("window", [(2, 1), (-1.7e308, 1.7e308), 5, (1, 2, 3), "ab"]),
        ("slab", [(2, 1)]),
        ("transform", ["front", np.diag([1, 1, 0, 1.0]), np.zeros((4, 4))]),
        ("overlay_window", [(0, 1)]),
    ],
)
def test_bad_values_of_attributes(name, values, viewer):
    text = {"transform": "view|matrix", "overlay_window": "there is no second volume"}.get(name, name)
    for value in values:
        with pytest.raises(ValueError, match=text):
            setattr(viewer, name, value)


def test_bad_calls(viewer):
    with pytest.raises(ValueError, match="there is no second volume"):
        print(viewer.overlay_window)
    with pytest.raises(AttributeError, match="windw"):
        viewer.windw = (0, 1)
    with pytest.raises(ValueError, match="place must be two finite numbers"):
        viewer.pick(np.nan, 3)
    with pytest.raises(TypeError, match="on_pick needs a function, but this is 3"):
        viewer.on_pick(3)


@pytest.mark.parametrize("trackball", [False, True])
@pytest.mark.parametrize("number", [np.nan, np.inf, -1e300])
def test_events_of_no_screen_change_nothing(number, trackball, viewer):
    press(viewer, *"t" * trackball)
    before = viewer._state
    for button in (1, 2, 3):
        send(viewer, "pointer_down", 60, 45, button=button)
        send(viewer, "pointer_move", number, 45)
        send(viewer, "pointer_up", 60, 45)
    for place in ((number, 45, -100), (60, number, -100), (60, 45, number)):
        send(viewer, "wheel", *place[:2], dy=place[2])
    viewer._settle()
    assert vars(viewer._state) == {**vars(before), "point": viewer.point, "message": ""}


def test_what_the_filter_refuses_is_told_once(image, open_viewer, caplog):
    viewer = open_viewer(image, window=(0, 1))
    viewer.transform = np.diag([1e200, 1, 1, 1])
    drawn(viewer)
    assert caplog.text.count("the picture cannot be made") == 1 and "Transform must be invertible" in caplog.text


def test_code_of_an_array(open_viewer):
    """Its place, a mask and ends at infinity."""
    voxels = np.random.default_rng(3).integers(0, 900, (9, 11, 14), np.int16)
    viewer = open_viewer(
        voxels, spacing=(2, 2.5, 5), slab=(-np.inf, 2.0), mask=np.ones(voxels.shape, bool), mask_label=None
    )
    code = viewer.code.replace("mask=mask", "mask=None")
    assert code != viewer.code and "spacing=[2, 2.5, 5]" in code and "slab=[float('-inf'), 2.0]" in code
    assert_array_equal(eval(code, {"mip": mip, "image": voxels}), viewer.project())
    with pytest.raises(ValueError, match="no command"):
        _ = viewer.command


def test_window_is_found_again_for_the_picture(image, open_viewer):
    parameters = {"view": "left", "slab": (-2, 2), "mode": "minimum"}
    expected = open_viewer(image, **parameters).window
    viewer = open_viewer(image)
    viewer.transform, viewer.slab, viewer.mode = parameters.values()
    viewer.window = None
    assert viewer.window == expected


@pytest.mark.parametrize("window", [None, (0, 900)])
def test_voxels_that_change(window, open_viewer, rng):
    voxels = rng.integers(0, 900, (9, 11, 14), np.int16)
    viewer = open_viewer(voxels, azimuth=20, window=window)
    before = drawn(viewer)
    voxels[:] = voxels // 2 if window else rng.integers(-5000, -900, voxels.shape)
    viewer.refresh()
    viewer._settle()
    wanted = open_viewer(voxels.copy(), azimuth=20, window=window)
    assert_array_equal(viewer.canvas.draw(), wanted.snapshot())
    assert (viewer.canvas.draw() != before).any()
    assert viewer.window == wanted.window and (viewer.window[1] < 0) == (window is None)


def test_a_setter_ends_a_turn_that_plays(image, viewer):
    press(viewer, " ")
    viewer.transform = "superior"
    viewer._settle()
    assert_array_equal(_scene.get_matrix(viewer.transform), _scene.get_matrix(_scene.make_view(image, "superior")))


def test_hands_do_not_end_the_pictures_of_scripts(image, open_viewer):
    viewer = open_viewer(image, exact=True)
    expected = viewer.snapshot()
    is_over = threading.Event()

    def move():
        while not is_over.is_set():
            viewer._scene.abort()

    hand = threading.Thread(target=move)
    hand.start()
    try:
        for _ in range(20):
            assert_array_equal(viewer.snapshot(), expected)
    finally:
        is_over.set()
        hand.join()


def test_nothing_is_kept_alive(image):
    viewer = show(image, canvas=RenderCanvas(size=SIZE))
    drawn(viewer)
    before = threading.active_count()
    viewer.close()
    viewer.close()
    press(viewer, "l")
    gone = weakref.ref(viewer)
    del viewer
    gc.collect()
    assert gone() is None
    assert threading.active_count() == before
