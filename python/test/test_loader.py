"""Projections in the workers of PyTorch's data loader, processes and threads."""

from concurrent.futures import ThreadPoolExecutor
from threading import Event

import numpy as np
import pytest
from itk_shearwarpmip import mip, sample, turn
from itk_shearwarpmip._front import _FILTERS_LOCK, _get_filters
from numpy.testing import assert_array_equal
from samples import make_oblique

torch = pytest.importorskip("torch")
from torch.utils.data import DataLoader, Dataset  # noqa: E402

VIEWS = [(azimuth, elevation) for azimuth in (0, 30, 75) for elevation in (-10, 40)]


class Pictures(Dataset):
    """Pictures and places of an image in memory, and a turn of it."""

    def __init__(self):
        self.image = make_oblique(np.random.default_rng(3))

    def __len__(self):
        return len(VIEWS)

    def __getitem__(self, number):
        azimuth, elevation = VIEWS[number]
        keywords = {"azimuth": azimuth, "elevation": elevation, "size": (30, 40)}
        picture, places = mip(self.image, places=True, threads=2, **keywords)
        frames = turn(self.image, transforms=["left", "superior"], exact=True, size=(30, 40)).frames
        return np.array(picture), sample(self.image, places), np.array(frames)


@pytest.fixture(scope="module")
def pictures():
    return Pictures()


@pytest.fixture(scope="module")
def expected(pictures):
    """From this process, whose threads of ITK the workers do not have."""
    return [pictures[number] for number in range(len(VIEWS))]


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_processes(method, pictures, expected):
    loader = DataLoader(pictures, batch_size=2, num_workers=2, multiprocessing_context=method, timeout=100)
    found = [each for batch in loader for each in zip(*batch, strict=True)]
    for of_item, should in zip(found, expected, strict=True):
        for each, other in zip(of_item, should, strict=True):
            assert_array_equal(each, other)


def test_threads(pictures, expected):
    with ThreadPoolExecutor(4) as threads:
        for number, found in enumerate(threads.map(pictures.__getitem__, [*range(len(VIEWS))] * 5)):
            for each, other in zip(found, expected[number % len(VIEWS)], strict=True):
                assert_array_equal(each, other)


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_fork_while_a_thread_projects(pictures, expected):
    """The thread and its locks are not in the worker."""
    projects, ends = Event(), Event()

    def project():
        with _get_filters(pictures.image), _FILTERS_LOCK:
            projects.set()
            ends.wait()

    with ThreadPoolExecutor(1) as threads:
        threads.submit(project)
        projects.wait()
        try:
            loader = DataLoader(pictures, batch_size=None, num_workers=1, multiprocessing_context="fork", timeout=30)
            assert_array_equal(next(iter(loader))[0], expected[0][0])
        finally:
            ends.set()
