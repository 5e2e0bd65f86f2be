"""Saving and loading: nothing lost, nothing half written, nothing foreign taken in."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given

from densities.examples import glmbs, lmbs, poissons, random_glmb, random_lmb
from vedette.densities import GLMB, LMB, FactoredGLMB, Poisson, TrackTable, load_density, save_density
from vedette.errors import InputError


def _arrays(density):
    found: dict = {}
    for field in fields(density):
        value = getattr(density, field.name)
        if isinstance(value, TrackTable):
            found |= _arrays(value)
        elif value is not None:
            found[field.name] = value
    return found


def _same_bits(a, b):
    assert type(a) is type(b)
    arrays_a, arrays_b = _arrays(a), _arrays(b)
    assert arrays_a.keys() == arrays_b.keys()
    for name, array in arrays_a.items():
        assert (array.dtype, array.shape) == (arrays_b[name].dtype, arrays_b[name].shape)
        assert array.tobytes() == arrays_b[name].tobytes()


@given(glmbs(), lmbs(), poissons())
def test_every_bit_is_kept(tmp_path_factory, glmb, lmb, poisson):
    path = tmp_path_factory.mktemp("densities") / "belief.npz"
    for density in (glmb, lmb, poisson):
        save_density(path, density)
        _same_bits(load_density(path), density)


@pytest.mark.parametrize("kind", [GLMB, FactoredGLMB])
def test_what_tracks_were_made_of_is_kept_where_it_is_known(tmp_path, kind):
    glmb = random_glmb(np.random.default_rng(3), 3, 5, 2)
    sources = np.arange(2 * glmb.tracks.num_tracks).reshape(-1, 2) - 2
    sources[0] = -1, -2
    known = replace(glmb, tracks=replace(glmb.tracks, sources=sources))
    density = known if kind is GLMB else FactoredGLMB.of(known)
    save_density(tmp_path / "belief", density)
    _same_bits(load_density(tmp_path / "belief"), density)
    assert "sources" in _arrays(load_density(tmp_path / "belief"))


def test_infinite_logits_and_weights_are_kept(tmp_path):
    lmb = LMB.from_bernoullis([[0, 0], [0, 1]], [1.0, 0.0], np.zeros((2, 1)), [np.eye(1)] * 2)
    poisson = Poisson.from_gaussians([0.0, 1.0], np.zeros((2, 1)), [np.eye(1)] * 2)
    for density in (lmb, poisson):
        save_density(tmp_path / "belief", density)
        _same_bits(load_density(tmp_path / "belief"), density)


def test_equal_densities_give_equal_files(tmp_path):
    for name in ("a", "b"):
        save_density(tmp_path / name, random_glmb(np.random.default_rng(3), 3, 5, 2))
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "belief.npz"
    old = random_lmb(np.random.default_rng(0), 3)
    save_density(path, old)

    def break_off(file, **arrays):
        file.write(b"half")
        raise OSError("disk full")

    monkeypatch.setattr(np, "savez", break_off)
    with pytest.raises(InputError, match="disk full"):
        save_density(path, GLMB.empty(2))
    monkeypatch.undo()
    _same_bits(load_density(path), old)
    assert [entry.name for entry in tmp_path.iterdir()] == ["belief.npz"]


def test_a_path_that_cannot_be_written_is_refused(tmp_path):
    with pytest.raises(InputError, match="missing"):
        save_density(tmp_path / "missing" / "belief.npz", GLMB.empty(2))
    with pytest.raises(InputError, match="TrackTable"):
        save_density(tmp_path / "x", TrackTable.empty(2))  # type: ignore[arg-type]


def test_damaged_files_are_refused(tmp_path):
    path = tmp_path / "belief.npz"
    save_density(path, random_glmb(np.random.default_rng(1), 3, 6, 2))
    whole = path.read_bytes()
    rng = np.random.default_rng(2)
    for length in (0, 1, 30, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        with pytest.raises(InputError, match=r"belief\.npz"):
            load_density(path)
    for place in rng.integers(0, len(whole), 200):
        damaged = bytearray(whole)
        damaged[place] ^= 0x55
        path.write_bytes(damaged)
        try:  # a byte that says nothing (a time stamp) may change; then all the rest is as it was
            density = load_density(path)
        except InputError:
            continue
        _same_bits(density, random_glmb(np.random.default_rng(1), 3, 6, 2))


def _stored(density):
    tracks = density.tracks
    arrays = {"format": "vedette-density", "version": 1, "kind": "lmb", "existence_logit": density.existence_logit}
    return arrays | {f"tracks.{field.name}": getattr(tracks, field.name) for field in fields(tracks)}


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"format": "other"}, "another origin"),
        ({"version": 2}, "version 1; got 2"),
        ({"kind": "phd"}, "got 'phd'"),
        ({"existence_logit": None}, "existence_logit"),
        ({"existence_logit": np.array([np.nan, 0.0])}, "existence_logit"),
        ({"existence_logit": np.zeros(3)}, "existence_logit"),
        ({"tracks.covs": np.zeros((2, 2, 2))}, r"tracks\.covs"),
        ({"tracks.labels": np.zeros((2, 2))}, r"tracks\.labels"),
    ],
)
def test_foreign_or_invalid_content_is_refused(tmp_path, change, match):
    arrays = _stored(random_lmb(np.random.default_rng(0), 2)) | change
    path = tmp_path / "belief.npz"
    np.savez(path, **{name: array for name, array in arrays.items() if array is not None})
    with pytest.raises(InputError, match=match) as caught:
        load_density(path)
    assert "belief.npz" in str(caught.value)


def test_other_files_are_refused(tmp_path):
    np.save(tmp_path / "array.npy", np.zeros(3))
    np.savez(tmp_path / "objects.npz", format=np.array([{"a": 1}], dtype=object))
    (tmp_path / "text.npz").write_text("not a density")
    for name in ("array.npy", "objects.npz", "text.npz", "missing.npz", "."):
        with pytest.raises(InputError, match="expected a density file"):
            load_density(tmp_path / name)


def test_a_small_file_that_unpacks_to_much_is_refused(tmp_path):
    path = tmp_path / "bomb.npz"
    np.savez_compressed(path, **(_stored(random_lmb(np.random.default_rng(0), 2)) | {"more": np.zeros(5_000_000)}))
    assert path.stat().st_size < 100_000
    with pytest.raises(InputError, match=r"bomb\.npz: expected a density file; .* bytes would unpack to 4"):
        load_density(path)
