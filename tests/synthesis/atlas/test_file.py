"""A file is read as it was written, or refused before HDF5 parses a damaged byte.

Catches silent damage, files that read other files, arrays that contradict the rule, and features that differ from the lengths.
"""

import hashlib
import io
from pathlib import Path

import h5py
import numpy as np
import pytest

import linkage_atlas as la
from synthesis.atlas import file as module
from synthesis.atlas import haar
from synthesis.atlas.file import HEADER_BYTES, check_contents, load_atlas, read_features
from synthesis.atlas.table import FEATURES, AtlasRule
from synthesis.errors import AtlasError, AtlasFault
from synthesis.four_bar import coupler_angle
from synthesis.fourbar.dimension_types import OrderRule, TypeRule
from tests.conftest import atlas_bytes
from tests.oracles import naive

RULES = [
    AtlasRule(TypeRule(60, 2, OrderRule.FULL_CRANK), 32),
    AtlasRule(TypeRule(44, 2, OrderRule.CRANK_SHORTEST), 16),
    AtlasRule(TypeRule(22), 16),
    AtlasRule(TypeRule(4), 16),
]


@pytest.fixture
def path(small_bytes, tmp_path) -> Path:
    (tmp_path / "atlas.h5").write_bytes(small_bytes)
    return tmp_path / "atlas.h5"


def refused(path: Path) -> AtlasFault:
    with pytest.raises(AtlasError) as error:
        load_atlas(path)
    return error.value.fault


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: str(rule.count))
def test_a_file_holds_the_types_and_features_of_its_rule(rule, tmp_path) -> None:
    path = tmp_path / "atlas.h5"
    path.write_bytes(atlas_bytes(rule))
    assert path.read_bytes() == atlas_bytes(rule)
    atlas = load_atlas(path)
    assert atlas.rule == rule and np.array_equal(atlas.lengths, rule.lengths())
    check_contents(path, atlas)
    features = read_features(path, atlas.sha256, slice(None))
    crank = 2 * np.pi * np.arange(rule.samples) / rule.samples
    for row in range(0, len(atlas.lengths), 37):
        lengths = atlas.lengths[row].astype(float)
        angle = coupler_angle(lengths, 1, crank)
        average, details = naive.haar(angle - features.winding[row] * crank)
        assert features.average[row] == pytest.approx(average, abs=1e-12)
        np.testing.assert_allclose(features.details[row], details, atol=1e-6)
    with h5py.File(path) as file:
        assert set(FEATURES) < set(file) and file.attrs["samples"] == rule.samples
        assert file.attrs["levels"] == haar.levels(rule.samples) and "units" in file["details"].attrs


@pytest.mark.parametrize("seed", range(20))
def test_a_flipped_bit_is_refused(path, seed: int) -> None:
    data, random = bytearray(path.read_bytes()), np.random.default_rng(seed)
    position = random.integers(HEADER_BYTES if seed % 5 == 0 else len(data))
    data[position] ^= 1 << random.integers(8)
    path.write_bytes(data)
    assert refused(path) in (AtlasFault.CHECKSUM, AtlasFault.SCHEMA)


@pytest.mark.parametrize("size", [0, 100, HEADER_BYTES, -1])
def test_a_file_that_is_cut_off_is_refused(path, size: int) -> None:
    path.write_bytes(path.read_bytes()[:size])
    assert refused(path) in (AtlasFault.CHECKSUM, AtlasFault.SCHEMA)


def external_link(file: h5py.File) -> None:
    del file["average"]
    file["average"] = h5py.ExternalLink("/etc/hostname", "average")


def soft_link(file: h5py.File) -> None:
    file.move("average", "other")
    file["average"] = h5py.SoftLink("/other")


def external_storage(file: h5py.File) -> None:
    shape = file["average"].shape
    del file["average"]
    file.create_dataset("average", shape, "<f8", external=[("/etc/hostname", 0, h5py.h5f.UNLIMITED)])


def virtual(file: h5py.File) -> None:
    shape = file["average"].shape
    del file["average"]
    layout = h5py.VirtualLayout(shape, "<f8")
    layout[:] = h5py.VirtualSource("/etc/hostname", "average", shape)
    file.create_virtual_dataset("average", layout)


def another_entry(file: h5py.File) -> None:
    file["more"] = np.zeros(3)


def another_type(file: h5py.File) -> None:
    values = file["tree_series"][...].astype("<f8")
    del file["tree_series"]
    file["tree_series"] = values


def other_lengths(file: h5py.File) -> None:
    file["lengths"][0, 0] += 1


def other_leaves(file: h5py.File) -> None:
    file["tree_rows"][0] = 1 << 30


def another_rule(file: h5py.File) -> None:
    file.attrs["rule"] = file.attrs["rule"].replace("60", "61")


def long_text(file: h5py.File) -> None:
    file.attrs["rule"] = "x" * 5000


CHANGES = [external_link, soft_link, external_storage, virtual, another_entry, another_type]
CHANGES += [other_lengths, other_leaves, another_rule, long_text]


@pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.__name__)
def test_a_sound_checksum_over_other_contents_is_refused(path, change) -> None:
    image = io.BytesIO(path.read_bytes()[HEADER_BYTES:])
    with h5py.File(image, "r+") as file:
        change(file)
    body = image.getvalue()
    path.write_bytes(module._header(hashlib.sha256(body).hexdigest(), len(body)) + body)
    assert refused(path) in (AtlasFault.SCHEMA, AtlasFault.CONTENT)


def test_other_features_are_found_by_verifying(path) -> None:
    image = io.BytesIO(path.read_bytes()[HEADER_BYTES:])
    with h5py.File(image, "r+") as file:
        file["details"][:, 3] += 0.01
    body = image.getvalue()
    path.write_bytes(module._header(hashlib.sha256(body).hexdigest(), len(body)) + body)
    with pytest.raises(AtlasError) as error:
        check_contents(path, load_atlas(path))
    assert error.value.fault is AtlasFault.CONTENT


def test_a_file_that_is_replaced_is_not_taken_for_the_other(path, tmp_path) -> None:
    atlas = la.load_atlas(path)
    atlas.check()
    path.write_bytes(atlas_bytes(RULES[1]))
    with pytest.raises(AtlasError) as error:
        atlas.check()
    assert error.value.fault is AtlasFault.CHECKSUM
