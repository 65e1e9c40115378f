#!/usr/bin/env python3
"""Writes a synthetic PET/CT with labels into the current folder:

ct.nrrd           a body on a table, in HU
pet.nrrd          three lesions and four organs, as SUV on a coarser grid
parts.nrrd        labels on the grid of the CT: 1 is bone, 2 the table
organs.seg.nrrd   the organs, with names and colours, as 3D Slicer writes them
"""

import itk
import numpy as np

random = np.random.default_rng(1)


def make_grid(size, spacing):
    """Places of voxels along x, y, z in mm; 0 is the body's middle."""
    return [(np.arange(n) - (n - 1) / 2) * step for n, step in zip(size, spacing, strict=True)]


def ellipsoid(grid, center, radii):
    """How far inside each voxel is: 1 at the center, 0 at the surface."""
    x, y, z = grid
    places = (x[None, None, :], y[None, :, None], z[:, None, None])
    return 1 - np.sqrt(sum(((p - c) / r) ** 2 for p, c, r in zip(places, center, radii, strict=True)))


def write(voxels, spacing, path, entries=None):
    image = itk.image_from_array(np.ascontiguousarray(voxels))
    image.SetSpacing(spacing)
    image.SetOrigin([-(n - 1) / 2 * step for n, step in zip(voxels.shape[::-1], spacing, strict=True)])
    for key, value in (entries or {}).items():
        image[key] = value
    itk.imwrite(image, path)


ORGANS = {
    "heart": ((25, -25, 60), (38, 34, 42), 3.0, "1 0.3 0.3"),
    "liver": ((-55, -10, -15), (62, 55, 48), 2.2, "0.35 0.9 0.4"),
    "left kidney": ((52, 35, -55), (20, 22, 42), 4.0, "0.3 0.75 1"),
    "bladder": ((0, -15, -235), (32, 30, 26), 9.0, "1 0.85 0.2"),
}
LESIONS = [((-70, 0, 95), 9, 8.0), ((15, 20, -120), 8, 7.0), ((-45, -25, -35), 10, 9.0)]

spacing = (2.0, 2.0, 2.0)
grid = make_grid((190, 140, 300), spacing)
x, y, z = (grid[0][None, None, :], grid[1][None, :, None], grid[2][:, None, None])
body = np.hypot(x / (150 - 0.1 * np.abs(z)), y / 95) < 1
bone = (np.hypot(x, y - 55) < 17) & (np.abs(np.sin(z / 11)) > 0.15)
ribs = np.abs(np.hypot(x / 135, y / 85) - 0.95) < 0.035
bone |= ribs & (np.abs((z - 0.35 * y) % 26 - 13) < 4.5) & (z > -40) & (z < 190)
for side in (-1, 1):
    bone |= (np.abs(ellipsoid(grid, (side * 62, 25, -185), (58, 60, 70))) < 0.07) & (side * x + y > 45)
table = (np.abs(y - 115 + 0.0012 * x**2) < 4) & (np.abs(x) < 120) & np.full(body.shape, True)
ct = np.where(body, 30, -1000) + random.normal(0, 15, body.shape)
labels = np.zeros(body.shape, np.uint8)
for number, (center, radii, _, _) in enumerate(ORGANS.values(), 3):
    organ = ellipsoid(grid, center, radii) > 0
    labels[organ] = number
    ct[organ] = 90 + random.normal(0, 10, np.count_nonzero(organ))
ct[bone & body] = 700 + random.normal(0, 80, np.count_nonzero(bone & body))
ct[table] = 300
write(ct.astype(np.int16), spacing, "ct.nrrd")
write(table.astype(np.uint8) * 2 + (bone & body), spacing, "parts.nrrd")
entries = {}
for number, (name, (*_, color)) in enumerate(ORGANS.items()):
    entries |= {
        f"Segment{number}_LabelValue": str(number + 3),
        f"Segment{number}_Layer": "0",
        f"Segment{number}_Name": name,
        f"Segment{number}_Color": color,
    }
write(labels, spacing, "organs.seg.nrrd", entries)

coarse = (4.1, 4.1, 5.0)
pet_grid = make_grid((84, 60, 116), coarse)
px, py, pz = (pet_grid[0][None, None, :], pet_grid[1][None, :, None], pet_grid[2][:, None, None])
pet = 0.5 * (np.hypot(px / (150 - 0.1 * np.abs(pz)), py / 95) < 1) * random.gamma(20, 1 / 20, (116, 60, 84))
sources = [(center, radii, uptake) for center, radii, uptake, _ in ORGANS.values()]
for center, radii, uptake in sources + [(c, (r, r, r), u) for c, r, u in LESIONS]:
    pet += (uptake - 0.5) / (1 + np.exp(np.clip(-14 * ellipsoid(pet_grid, center, radii), None, 50)))
write(pet.astype(np.float32), coarse, "pet.nrrd")
