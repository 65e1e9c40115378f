"""Projections with a derivative."""

import doctest
import subprocess
import sys

import itk
import numpy as np
import pytest
from itk_shearwarpmip import turn
from numpy.testing import assert_allclose, assert_array_equal
from samples import make_rotation

torch = pytest.importorskip("torch")
from itk_shearwarpmip.torch import mip  # noqa: E402

OBLIQUE = itk.array_from_matrix(make_rotation(0.2, -0.3, 0.4).GetMatrix())
SHEARED = OBLIQUE @ [[1, 0.6, 0], [0, 0.8, 0], [0, 0, 1]]
PLACE = {"spacing": (0.7, 0.9, 1.1), "origin": (12.0, -3.0, 5.5), "direction": SHEARED}
MATRIX = np.array([[0.8, 0, 0.6, 1], [0, 1, 0, 0], [-0.6, 0, 0.8, -2], [0, 0, 0, 1]])


def make_volume(rng, dtype=torch.float64, shape=(2, 1, 4, 5, 6), **keywords):
    return torch.from_numpy(rng.normal(size=shape)).to(dtype).requires_grad_(**keywords)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("views", [["anterior", MATRIX, make_rotation(1, 2, 3)], None], ids=["views", "turn"])
def test_values_are_those_of_turn(views, dtype, rng):
    volume = make_volume(rng, dtype, (2, 3, 4, 5, 6))
    keywords = PLACE | ({"transforms": views} if views else {"frames": 4, "angular_range": 180, "elevation": 20})
    pictures = mip(volume, views, **PLACE | ({} if views else keywords))
    assert (pictures.dtype, pictures.ndim) == (dtype, 5)
    for batch, channel in np.ndindex(2, 3):
        expected = turn(volume[batch, channel].detach().numpy(), **keywords, exact=True, background=0)
        assert_array_equal(pictures[batch, channel].detach(), expected.frames)


@pytest.mark.parametrize(
    "keywords",
    [
        {},
        {"mode": "minimum"},
        {"mode": "absolute_maximum"},
        {"slab": (-0.7, 0.8), "background": -7.0},
        {"crop": ((11, -4, 3), (15, 2, 8)), "mode": "minimum"},
        {"size": (3, 4), "output_spacing": (1.3, 0.6), "output_origin": (-1, -1)},
    ],
    ids=str,
)
def test_gradcheck(keywords, rng):
    volume = make_volume(rng, shape=(2, 1, 3, 3, 4))
    view = MATRIX.copy()
    view[:3, 3] = PLACE["origin"] + (SHEARED * PLACE["spacing"]) @ [1.5, 1, 1]
    views = [view, make_rotation(1, 2, 3)]

    def project(each):
        return mip(each, views, **{**PLACE, "output_spacing": 1.2, **keywords})

    assert torch.autograd.gradcheck(project, volume)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_gradient_is_weights(dtype, rng):
    volume = make_volume(rng, dtype, (1, 1, 8, 9, 10))
    pictures = mip(volume, frames=5, elevation=30, background=-100.0, **PLACE)
    is_background = pictures == -100
    assert 0.1 < is_background.double().mean() < 0.9
    pictures.sum().backward()
    assert volume.grad.dtype == dtype
    # the weights of a pixel sum to 1, and those times the voxels to its value
    rounding = 1e-4 if dtype == torch.float32 else 1e-6
    assert volume.grad.sum().item() == pytest.approx((~is_background).sum().item(), rel=1e-6)
    values = pictures[~is_background].sum().item()
    assert (volume.grad * volume).sum().item() == pytest.approx(values, rel=rounding)


def test_gradient_goes_to_the_maximum():
    """Along the axes, every maximum is a voxel."""
    voxels = np.random.default_rng(4).permutation(4 * 5 * 6).reshape(1, 1, 4, 5, 6).astype(np.float32)
    volume = torch.tensor(voxels, requires_grad=True)
    for view, axis in (("anterior", 1), ("posterior", 1), ("left", 2), ("right", 2), ("superior", 0), ("inferior", 0)):
        pictures = mip(volume, [view])
        factors = 1 + pictures.detach()
        (gradient,) = torch.autograd.grad((pictures * factors).sum(), volume)
        is_maximum = voxels[0, 0] == voxels[0, 0].max(axis, keepdims=True)
        assert_allclose(gradient[0, 0], np.where(is_maximum, 1 + voxels[0, 0], 0), 1e-5)


def test_ties_go_to_the_nearest():
    volume = torch.zeros(1, 1, 4, 5, 6, requires_grad=True)
    mip(volume, ["anterior"]).sum().backward()
    expected = np.zeros((4, 5, 6))
    expected[:, 0] = 1
    assert_array_equal(volume.grad[0, 0], expected)


def test_beside_the_volume():
    volume = torch.ones(1, 1, 4, 5, 6, requires_grad=True)
    pictures = mip(volume, ["anterior"], size=(3, 3), output_origin=(100, 100), background=5.0)
    assert (pictures == 5).all()
    pictures.sum().backward()
    assert (volume.grad == 0).all()


def test_without_a_gradient(rng):
    volume = make_volume(rng, requires_grad=False)
    assert not mip(volume, ["left"]).requires_grad
    with torch.no_grad():
        assert not mip(volume.requires_grad_(), ["left"]).requires_grad


def test_order_in_memory(rng):
    volume = make_volume(rng)
    turned = volume.detach().permute(4, 3, 2, 1, 0).contiguous().permute(4, 3, 2, 1, 0).requires_grad_()
    for each in (volume, turned):
        mip(each, ["left", MATRIX]).square().sum().backward()
    assert_array_equal(volume.grad, turned.grad)


def test_errors(rng):
    volume = make_volume(rng)
    for wrong in (volume[0], volume.half(), volume.int(), volume.detach().numpy(), None):
        with pytest.raises(
            TypeError, match=r"volume must be a tensor \(batch, channel, z, y, x\) of float32 or float64"
        ):
            mip(wrong, ["left"])
    with pytest.raises(ValueError, match="volume must not be empty"):
        mip(volume[:0], ["left"])
    with pytest.raises(ValueError, match="transforms must be a list of views"):
        mip(volume, "left")
    with pytest.raises(ValueError, match=r"exact .*local_maximum"):
        mip(volume, ["left"], local_maximum=3.0)
    with pytest.raises(TypeError, match="multiple values for keyword argument 'exact'"):
        mip(volume, ["left"], exact=False)
    (gradient,) = torch.autograd.grad(mip(volume, ["left"]).square().sum(), volume, create_graph=True)
    with pytest.raises(RuntimeError, match="once_differentiable"):
        gradient.sum().backward()


def test_without_pytorch():
    code = "import sys; sys.modules['torch'] = None; import itk_shearwarpmip.torch"
    outcome = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert outcome.returncode == 1
    assert outcome.stderr.endswith(
        "ImportError: itk_shearwarpmip.torch needs PyTorch: install the wheel with its extra [torch]\n"
    )


def test_docstring():
    result = doctest.testmod(sys.modules["itk_shearwarpmip.torch"])
    assert result.attempted and not result.failed
