#!/usr/bin/env python3
"""A day's work in radiology: a folder comes in, a turning MIP goes to the archive.

The archive is an Orthanc of Debian's package `orthanc`, in a temporary folder and for this computer only. The turn is
stored there, listed and fetched back, and its pixels are compared with those that were sent.

    radiology_day.py study-folder turn-folder --series thorax
"""

import argparse
import contextlib
import io
import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pydicom

PROGRAM = os.environ.get("SHEARWARPMIP_PROGRAM", "shear-warp-mip")
ORTHANC = shutil.which("Orthanc", path=f"{os.environ.get('PATH', '')}:/usr/sbin")


def ask(url: str, data: bytes | None = None) -> bytes:
    """What the archive answers: to a GET or, with data, to a POST."""
    with urllib.request.urlopen(url, data, timeout=30) as answer:
        return bytes(answer.read())


@contextlib.contextmanager
def archive() -> Iterator[str]:
    """The address of an archive that is there for a while."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with tempfile.TemporaryDirectory() as folder:
        settings = {
            "StorageDirectory": folder,
            "HttpPort": port,
            "RemoteAccessAllowed": False,
            "AuthenticationEnabled": False,
            "DicomServerEnabled": False,
        }
        configuration = Path(folder, "orthanc.json")
        configuration.write_text(json.dumps(settings))
        assert ORTHANC
        with open(Path(folder, "log"), "w") as log:
            server = subprocess.Popen([ORTHANC, configuration], stdout=log, stderr=log)
        try:
            url = f"http://127.0.0.1:{port}"
            for _ in range(300):
                with contextlib.suppress(OSError):
                    ask(f"{url}/system")
                    break
                time.sleep(0.1)
            else:
                sys.exit("error: the archive does not start")
            yield url
        finally:
            server.terminate()
            server.wait()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study", type=Path, help="a DICOM folder, with folders in it")
    parser.add_argument("turn", type=Path, help="a new folder for the turn")
    parser.add_argument("--series", help="a number of the list that is shown without it, or a part of the description")
    parser.add_argument("--frames", type=int, default=36, help="how many pictures [36]")
    arguments = parser.parse_args()

    command = [PROGRAM, arguments.study, f"{arguments.turn}/", f"--frames={arguments.frames}"]
    if arguments.series:
        command.append(f"--series={arguments.series}")
    if subprocess.run(command, check=False).returncode != 0:
        sys.exit(1)
    files = sorted(arguments.turn.iterdir())
    print(f"made {len(files)} pictures")

    if not ORTHANC:
        print("skipped: no archive is installed; on Debian: apt-get install orthanc")
        return
    with archive() as url:
        sent = {}
        for file in files:
            answer = json.loads(ask(f"{url}/instances", file.read_bytes()))
            sent[answer["ID"]] = file
        print(f"stored {len(sent)} pictures")

        for name in json.loads(ask(f"{url}/series")):
            series = json.loads(ask(f"{url}/series/{name}"))
            tags = series["MainDicomTags"]
            print(f"listed: {tags['SeriesDescription']}, {tags['Modality']}, {len(series['Instances'])} pictures")
            for instance in series["Instances"]:
                fetched = pydicom.dcmread(io.BytesIO(ask(f"{url}/instances/{instance}/file")))
                if fetched.PixelData != pydicom.dcmread(sent.pop(instance)).PixelData:
                    sys.exit(f"error: the archive has changed picture {instance}")
        if sent:
            sys.exit(f"error: the archive has lost {len(sent)} pictures")
        print("fetched: all pixels are equal")


if __name__ == "__main__":
    main()
