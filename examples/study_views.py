#!/usr/bin/env python3
"""Projects PET studies to arrays: SUV from 48 views each, and the CT and the labels where each SUV maximum lies.

study_views.py studies arrays: reads studies/*/{pet,ct,labels}.nii.gz, on any grids, and writes arrays/*.npz
"""

import sys
from pathlib import Path

import numpy as np
from itk_shearwarpmip import sample, turn

if len(sys.argv) != 3:
    sys.exit(__doc__)
studies, arrays = map(Path, sys.argv[1:])
arrays.mkdir(exist_ok=True)
for study in sorted({file.parent for file in studies.glob("*/pet.nii.gz")}):
    views = turn(study / "pet.nii.gz", frames=48, angular_range=180, exact=True, places=True)
    ct = sample(study / "ct.nii.gz", views.places)
    labels = sample(study / "labels.nii.gz", views.places, "nearest", outside=0)
    np.savez_compressed(arrays / study.name, suv=np.asarray(views.frames), ct=ct.astype(np.float32), labels=labels)
