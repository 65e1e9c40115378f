"""Turns in an archive: Debian's orthanc, and by DICOMweb if orthanc-dicomweb is there.

SHEAR_WARP_MIP=shear-warp-mip python3 -m pytest test_archive.py
"""

import io
import json
import shutil
import socket
import subprocess
import time
import urllib.error
import urllib.request
from pathlib import Path

import numpy as np
import pydicom
import pytest
from test_pet import run, write_pet

ORTHANC = shutil.which("Orthanc", path="/usr/sbin:/usr/local/sbin:/usr/bin")
pytestmark = pytest.mark.skipif(not ORTHANC, reason="orthanc is not installed")
DICOMWEB = Path("/usr/share/orthanc/plugins/libOrthancDicomWeb.so")
FRAMES = 6


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """Its address, on the loopback interface only."""
    folder = tmp_path_factory.mktemp("archive")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    configuration = {
        "HttpPort": port,
        "DicomServerEnabled": False,
        "RemoteAccessAllowed": False,
        "AuthenticationEnabled": False,
        "StorageDirectory": str(folder),
        "IndexDirectory": str(folder),
        "Plugins": [str(DICOMWEB)] if DICOMWEB.exists() else [],
        "DicomWeb": {"Enable": True, "Root": "/dicom-web/"},
    }
    (folder / "orthanc.json").write_text(json.dumps(configuration))
    with (folder / "log").open("w") as log:
        process = subprocess.Popen([ORTHANC, folder / "orthanc.json"], stdout=log, stderr=log)
    try:
        address = f"http://127.0.0.1:{port}"
        for _ in range(300):
            assert process.poll() is None, (folder / "log").read_text()
            try:
                get(f"{address}/system")
                break
            except urllib.error.URLError:
                time.sleep(0.1)
        yield address
    finally:
        process.terminate()
        process.wait()


def get(address, accept="application/json", data=None):
    request = urllib.request.Request(address, data, {"Accept": accept})
    with urllib.request.urlopen(request, timeout=60) as answer:
        return answer.read()


def store(archive, folder):
    """The files' data sets, in the order of their names, and the archive's name for the series."""
    files = sorted(folder.iterdir())
    names = {json.loads(get(f"{archive}/instances", data=file.read_bytes()))["ParentSeries"] for file in files}
    assert len(names) == 1
    return [pydicom.dcmread(file) for file in files], names.pop()


@pytest.fixture(scope="module", params=["single", "multi-frame", "secondary"])
def turn(request, archive, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    options = {"single": [], "multi-frame": ["--multi-frame"], "secondary": ["--elevation", 20]}[request.param]
    pet = write_pet(folder / "pet")
    run(pet, folder / "mip.mha", "--frames", FRAMES, "--dicom-out", folder / "turn", *options)
    return store(archive, folder / "turn")


def test_series(archive, turn):
    sent, name = turn
    series = json.loads(get(f"{archive}/series/{name}"))
    assert series["MainDicomTags"]["SeriesInstanceUID"] == sent[0].SeriesInstanceUID
    found = json.loads(get(f"{archive}/series/{name}/ordered-slices"))["Dicom"] if len(sent) > 1 else None
    instances = [found_name.split("/")[2] for found_name in found or [f"/instances/{series['Instances'][0]}/file"]]
    # the order of the archive is by Instance Number where planes are not parallel
    fetched = [pydicom.dcmread(io.BytesIO(get(f"{archive}/instances/{instance}/file"))) for instance in instances]
    assert [dataset.SOPInstanceUID for dataset in fetched] == [dataset.SOPInstanceUID for dataset in sent]
    for one, other in zip(sent, fetched):
        np.testing.assert_array_equal(one.pixel_array, other.pixel_array)
    # what it shows
    for instance, dataset in zip(instances, sent):
        frames = json.loads(get(f"{archive}/instances/{instance}/frames"))
        assert len(frames) == dataset.get("NumberOfFrames", 1)
        assert get(f"{archive}/instances/{instance}/frames/{frames[-1]}/preview", "image/png")[:4] == b"\x89PNG"


@pytest.mark.skipif(not DICOMWEB.exists(), reason="orthanc-dicomweb is not installed")
def test_dicomweb(archive, turn):
    sent, _ = turn
    study = f"{archive}/dicom-web/studies/{sent[0].StudyInstanceUID}"
    answer = get(f"{study}/series/{sent[0].SeriesInstanceUID}/instances", "application/dicom+json")
    listed = sorted(json.loads(answer), key=lambda instance: instance["00200013"]["Value"][0])
    assert [instance["00080018"]["Value"][0] for instance in listed] == [dataset.SOPInstanceUID for dataset in sent]
    for dataset in sent:
        path = f"{study}/series/{sent[0].SeriesInstanceUID}/instances/{dataset.SOPInstanceUID}/frames/1"
        part = get(path, 'multipart/related; type="application/octet-stream"')
        pixels = dataset.pixel_array if "NumberOfFrames" not in dataset else dataset.pixel_array[0]
        assert pixels.tobytes() in part
