"""Shared by the interop checks: reporting, the content hash, and the files of a release."""

import hashlib
import json
import struct
import sys
from pathlib import Path

import pyarrow.parquet as pq
import rasterio


class Mismatch(Exception):
    """An independent reader disagrees with the release."""


def expect(condition, sentence):
    if not condition:
        raise Mismatch(sentence)


class ContentHash:
    """SHA-256 of decoded content, as `sastrugi_store::digest` defines it."""

    def __init__(self, kind):
        self.sha256 = hashlib.sha256()
        self.text(kind)

    def raw(self, data):
        self.sha256.update(data)

    def bytes(self, data):
        self.u64(len(data))
        self.raw(data)

    def text(self, text):
        self.bytes(text.encode())

    def u64(self, value):
        self.raw(struct.pack("<Q", value))

    def f64(self, value):
        self.raw(struct.pack("<d", value))

    def hex(self):
        return self.sha256.hexdigest()


def manifest(release):
    return json.loads((release / "manifest.json").read_text())


def read_raster(path):
    """Heights or codes of a GeoTIFF, and its transform from columns and rows."""
    with rasterio.open(path) as raster:
        return raster.read(1).astype(float), raster.transform


def table(release, name):
    """The rows of a table, in the order of its files."""
    files = sorted((release / "tables" / name).glob("*.parquet"))
    return [row for file in files for row in pq.read_table(file).to_pylist()]


def is_release(path):
    return path.is_dir() and (path / "manifest.json").exists()


def run(check_release, check_files):
    """Checks the release or the files named on the command line and prints the results as JSON."""
    paths = [Path(argument) for argument in sys.argv[1:]]
    if not paths:
        sys.exit(f"usage: {sys.argv[0]} RELEASE | FILE...")
    try:
        figures = check_release(paths[0]) if is_release(paths[0]) else check_files(paths)
    except Mismatch as mismatch:
        sys.exit(str(mismatch))
    json.dump(figures, sys.stdout, indent=1, sort_keys=True)
    print()
