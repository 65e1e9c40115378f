#!/usr/bin/env python3
"""Views of a volume by ray casting on a GPU, with CuPy: what a graphics card of this computer takes.

Each thread of the GPU follows the ray of one pixel, with one sample in each slice along the axis that the ray is nearest
to, as the filter does. There are two ways to interpolate: by the card's textures, whose weights have 8 bits, and in
single precision from the voxels. Times are of one view, without the volume's way to the card, which has a line of its
own; `to here` adds the picture's way back.

    pip install cupy-cuda13x numpy
    gpu.py --size 512 --output results
    gpu.py --smoke                     # only whether it works

The script fails if the pictures in single precision differ from a reference on the CPU by more than a grey level.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import cupy as cp
import numpy as np
from cupy.cuda import texture

KERNEL = r"""
__device__ float sample(const unsigned short * voxels, int n, float x, float y, float z)
{
  const float fx = floorf(x), fy = floorf(y), fz = floorf(z);
  const int i = (int)fx, j = (int)fy, k = (int)fz;
  const auto get = [=](int a, int b, int c) {
    return (float)voxels[((size_t)min(max(c, 0), n - 1) * n + min(max(b, 0), n - 1)) * n + min(max(a, 0), n - 1)];
  };
  const float p = x - fx, q = y - fy, r = z - fz;
  const float a = get(i, j, k) * (1 - p) + get(i + 1, j, k) * p;
  const float b = get(i, j + 1, k) * (1 - p) + get(i + 1, j + 1, k) * p;
  const float c = get(i, j, k + 1) * (1 - p) + get(i + 1, j, k + 1) * p;
  const float d = get(i, j + 1, k + 1) * (1 - p) + get(i + 1, j + 1, k + 1) * p;
  const float e = a * (1 - q) + b * q, f = c * (1 - q) + d * q;
  return e * (1 - r) + f * r;
}

struct Ray { float start[3], step[3]; };

// rays begin in the first slice along the principal axis; m is view space to voxels: start = m (u, v, 0), direction w
__device__ Ray find_ray(const float * m, int axis, float u, float v)
{
  Ray ray;
  const float along = m[4 * axis + 2];
  const float begin = -(m[4 * axis] * u + m[4 * axis + 1] * v + m[4 * axis + 3]) / along;
  for (int n = 0; n < 3; ++n)
  {
    ray.start[n] = m[4 * n] * u + m[4 * n + 1] * v + m[4 * n + 3] + m[4 * n + 2] * begin;
    ray.step[n] = m[4 * n + 2] / along;
  }
  return ray;
}

extern "C" __global__ void project(unsigned long long texture, const unsigned short * voxels, int n, const float * m,
                                   int axis, int length, float * picture)
{
  const int column = blockIdx.x * blockDim.x + threadIdx.x, row = blockIdx.y * blockDim.y + threadIdx.y;
  if (column >= length || row >= length)
    return;
  const Ray ray = find_ray(m, axis, column - 0.5f * (length - 1), row - 0.5f * (length - 1));
  float most = 0;
  const float low = -0.5f, high = n - 0.5f;
  for (int k = 0; k < n; ++k)
  {
    const float x = ray.start[0] + k * ray.step[0], y = ray.start[1] + k * ray.step[1], z = ray.start[2] + k * ray.step[2];
    if (x >= low && x <= high && y >= low && y <= high && z >= low && z <= high)
      most = fmaxf(most, texture ? 65535.0f * tex3D<float>(texture, x + 0.5f, y + 0.5f, z + 0.5f)
                                 : sample(voxels, n, x, y, z));
  }
  picture[row * length + column] = most;
}
"""


def make_volume(n: int) -> np.ndarray:
    """Smooth structures and noise of 16 bits (z, y, x)."""
    z, y, x = (np.linspace(-3, 3, n, dtype=np.float32) for _ in range(3))
    smooth = np.sin(5 * z)[:, None, None] * np.sin(4 * y)[:, None] * np.sin(6 * x)
    noise = np.random.default_rng(0).integers(0, 4096, (n, n, n), np.uint16)
    return (noise + (20000 * (1 + smooth)).astype(np.uint16)).astype(np.uint16)


def make_views(count: int) -> list[np.ndarray]:
    """Rotations, view space to voxels: a turn about z, seen from 20 degrees above."""
    views = []
    for angle in np.radians(np.arange(count) * 360 / count + 5):
        c, s, e = np.cos(angle), np.sin(angle), np.radians(20)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], float)
        tilt = np.array([[1, 0, 0], [0, np.cos(e), -np.sin(e)], [0, np.sin(e), np.cos(e)]])
        views.append(turn @ tilt)
    return views


def project_reference(volume: np.ndarray, view: np.ndarray, pixels: np.ndarray, length: int) -> np.ndarray:
    """The same rule on the CPU, in double precision, for some pixels (column, row)."""
    n = volume.shape[0]
    axis = int(np.argmax(np.abs(view[:, 2])))
    u, v = (pixels - (length - 1) / 2).T
    start = view[:, :1] * u + view[:, 1:2] * v + (n - 1) / 2
    step = view[:, 2:] / view[axis, 2]
    start = start - step * start[axis]
    places = start[:, :, None] + step[:, :, None] * np.arange(n)
    inside = ((places >= -0.5) & (places <= n - 0.5)).all(0)
    low = np.floor(places).astype(int)
    part = places - low
    values = np.zeros(inside.shape)
    for corner in range(8):
        bits = [corner >> k & 1 for k in range(3)]
        x, y, z = (np.clip(low[k] + bits[k], 0, n - 1) for k in range(3))
        weights = np.prod([part[k] if bits[k] else 1 - part[k] for k in range(3)], 0)
        values += weights * volume[z, y, x]
    return np.where(inside, values, 0).max(1)


def measure(function, repetitions: int) -> float:
    """The median time in ms, by the card's clock."""
    function()
    times = []
    for _ in range(repetitions):
        begin, end = cp.cuda.Event(), cp.cuda.Event()
        begin.record()
        function()
        end.record()
        end.synchronize()
        times.append(cp.cuda.get_elapsed_time(begin, end))
    return float(np.median(times))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, nargs="+", default=[256, 512], help="voxels along each axis [256 512]")
    parser.add_argument("--views", type=int, default=12, help="views of a turn [12]")
    parser.add_argument("--output", type=Path, help="folder of gpu.md [none]")
    parser.add_argument("--smoke", action="store_true", help="a small volume: the times are void")
    options = parser.parse_args()
    if options.smoke:
        options.size, options.views = [32], 3
    kernel = cp.RawModule(code=KERNEL, options=("--std=c++17",)).get_function("project")
    card = cp.cuda.runtime.getDeviceProperties(0)["name"].decode()
    rows = []
    for n in options.size:
        volume = make_volume(n)
        begin = time.perf_counter()
        voxels = cp.asarray(volume)
        cp.cuda.Device().synchronize()
        upload = 1000 * (time.perf_counter() - begin)
        form = texture.ChannelFormatDescriptor(16, 0, 0, 0, cp.cuda.runtime.cudaChannelFormatKindUnsigned)
        array = texture.CUDAarray(form, n, n, n)
        begin = time.perf_counter()
        array.copy_from(volume)
        cp.cuda.Device().synchronize()
        texture_upload = 1000 * (time.perf_counter() - begin)
        clamp = cp.cuda.runtime.cudaAddressModeClamp
        description = texture.TextureDescriptor(
            (clamp,) * 3, cp.cuda.runtime.cudaFilterModeLinear, cp.cuda.runtime.cudaReadModeNormalizedFloat
        )
        resource = texture.ResourceDescriptor(cp.cuda.runtime.cudaResourceTypeArray, array)
        lookup = texture.TextureObject(resource, description)
        length = int(np.ceil(n * np.sqrt(3)))
        picture = cp.zeros((length, length), cp.float32)
        grid, block = ((length + 15) // 16,) * 2, (16, 16)
        for name, handle, way in (("textures", lookup.ptr, texture_upload), ("single precision", 0, upload)):
            times, back, worst = [], [], 0.0
            for view in make_views(options.views):
                m = np.hstack([view, np.full((3, 1), (n - 1) / 2)])
                axis = int(np.argmax(np.abs(view[:, 2])))
                arguments = (np.uint64(handle), voxels, np.int32(n), cp.asarray(m, cp.float32), np.int32(axis))
                call = (grid, block, (*arguments, np.int32(length), picture))
                times.append(measure(lambda call=call: kernel(*call), 20))
                back.append(measure(lambda call=call: (kernel(*call), call[2][-1].get()), 5))
                pixels = np.random.default_rng(1).integers(length // 4, 3 * length // 4, (200, 2))
                expected = project_reference(volume, view, pixels, length)
                found = picture.get()[pixels[:, 1], pixels[:, 0]]
                worst = max(worst, float(np.abs(found - expected).max()))
            if handle == 0 and worst > 1:
                sys.exit(f"error: pictures differ by {worst:.3g} grey levels from the reference")
            cells = [f"{n}^3", name, *(f"{each:.3g}" for each in (np.mean(times), np.mean(back), way, worst))]
            rows.append("| " + " | ".join(cells) + " |")
    header = "| volume | interpolation | a view, ms | to here, ms | volume to the card, ms | largest difference |"
    text = "\n".join([f"{card}\n", header, "|---|---|---:|---:|---:|---:|", *rows])
    if options.output:
        options.output.mkdir(parents=True, exist_ok=True)
        (options.output / "gpu.md").write_text(text + "\n")
    print(text)


if __name__ == "__main__":
    main()
