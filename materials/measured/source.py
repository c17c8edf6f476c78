"""Whatever holds measured reflectance, opened by what it is: files of the field, folders of photographs, formats of our own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..abrdf import ABRDF
from ..foundation.errors import InputError
from ..spectrum import rgb_weights, wavelengths_of
from .photographs import Photographs

if TYPE_CHECKING:
    from .measurement_file import MeasurementFile

KINDS = ("auto", "cornell", "merl", "pbsdf", "rgl", "ubo2003", "ubo2014", "btf", "photographs", "recording", "measurement")
_SUFFIXES = {
    ".brdf": "cornell",
    ".binary": "merl",
    ".pbsdf": "pbsdf",
    ".bsdf": "rgl",
    ".btf": "ubo2014",
    ".zip": "ubo2003",
    ".npz": "btf",
}


@dataclass(frozen=True)
class Source:
    """Measured reflectance, ready for a fit.

    Attributes
    ----------
    kind, name : str
        What it is and what it is called.
    mask : (H, W) bool
        Where there are texels; in row order.
    block : function of (first, last)
        Returns those texels as an ABRDF with one texel axis and the channels R, G, B; so that not all need be in memory.
    photographs : Photographs or None
        Of an object seen from one side, whose normals photometric stereo finds.
    notes : tuple of str
        What a report should say about the data.
    """

    kind: str
    name: str
    mask: NDArray[np.bool_]
    block: Callable[[int, int], ABRDF]
    photographs: Photographs | None = None
    notes: tuple[str, ...] = ()

    @property
    def num_texels(self) -> int:
        """Number of texels."""
        return int(self.mask.sum())


def open_source(path: str | Path, kind: str = "auto", images: slice | None = None) -> Source:
    """Open measured reflectance.

    Parameters
    ----------
    path : path
        File or folder.
    kind : str
        One of `KINDS`; `auto` goes by suffix and content.
    images : slice, optional
        Some of the photographs only.

    Raises
    ------
    InputError
        If the kind cannot be told or is unknown, or as the reader of the kind.
    """
    path = Path(path)
    if not path.exists():
        raise InputError("exist", file=path, remedy="Check the path.")
    if kind == "auto":
        kind = _kind(path)
    if kind == "cornell":
        from .cornell import read_cornell

        return _of_abrdf(kind, read_cornell(path))
    if kind == "merl":
        from .merl import read_merl

        # 1.46 million samples say little more than every second one each way; the narrow half angles are kept.
        return _of_abrdf(kind, read_merl(path, (1, 3, 3)), "Every third difference angle and azimuth of the table is used.")
    if kind == "pbsdf":
        from .tensor_file import read_pbsdf

        return _of_abrdf(kind, read_pbsdf(path))
    if kind == "rgl":
        from .rgl import read_rgl

        brdf = read_rgl(path)
        samples = brdf.samples() if brdf.isotropic else brdf.samples(60)
        return _of_abrdf(kind, samples, f"The tables were evaluated at {len(samples.wi)} pairs of directions up to 80°.")
    if kind == "ubo2014":
        from .ubo2014 import read_ubo2014

        btf = read_ubo2014(path)
        return _of_blocks(kind, btf.name, np.ones((btf.height, btf.width), bool), btf.block)
    if kind == "ubo2003":
        from .ubo2003 import read_ubo2003

        pictures = read_ubo2003(path)
        mask = np.ones((pictures.height, pictures.width), bool)
        return _of_blocks(kind, pictures.name, mask, pictures.block, "The response of the pictures is taken to be sRGB.")
    if kind == "btf":
        from ..btf import read_btf

        own = read_btf(path)
        note = f"The BTF is compressed, with a relative error of {own.relative_error:.3g}."
        return _of_blocks(kind, own.name or path.stem, own.mask, own.decompress, note)
    if kind == "photographs":
        from .photographs import read_photographs

        return _of_photographs(kind, read_photographs(path, images))
    if kind == "recording":
        from .recording_photographs import read_recording_photographs

        return _of_photographs(kind, read_recording_photographs(path, images=images))
    if kind == "measurement":
        from .measurement_file import read_measurement

        measured = read_measurement(path)
        if measured.samples is None:
            must = "hold wi and wo for a BRDF"
            raise InputError(must, got="conditions", file=path, remedy="See `materials.wetness_fit`.")
        return _of_abrdf(kind, measured.samples)
    raise InputError(f"be one of {', '.join(KINDS)}", got=kind, key="kind")


def read_brdf(path: str | Path) -> ABRDF | None:
    """Return the samples of a file that holds the BRDF of one point, with all its channels; None if `path` is anything else."""
    path = Path(path)
    kind = _SUFFIXES.get(path.suffix.lower()) if path.is_file() else None
    if kind == "cornell":
        from .cornell import read_cornell

        return read_cornell(path)
    if kind == "merl":
        from .merl import read_merl

        return read_merl(path, (2, 6, 12))
    if kind == "pbsdf":
        from .tensor_file import read_pbsdf

        return read_pbsdf(path)
    if kind == "rgl":
        from .rgl import read_rgl

        brdf = read_rgl(path)
        return brdf.samples() if brdf.isotropic else brdf.samples(60)
    return None


def read_conditions(path: str | Path, kind: str = "auto") -> MeasurementFile | None:
    """Return a measurement/1 of conditions, such as moisture; None if `path` is anything else (`open_source` opens that)."""
    path = Path(path)
    if not path.exists() or (_kind(path) if kind == "auto" else kind) != "measurement":
        return None
    from .measurement_file import read_measurement

    measured = read_measurement(path)
    return measured if measured.conditions is not None else None


def _kind(path: Path) -> str:
    if path.is_dir():
        for name, kind in (
            ("measurement.json", "measurement"),
            ("recording.json", "recording"),
            ("light_directions.txt", "photographs"),
        ):
            if (path / name).is_file():
                return kind
        remedy = "Known: light_directions.txt (photographs), recording.json, measurement.json."
        raise InputError("be a folder of measured reflectance", file=path, remedy=remedy)
    if path.suffix.lower() in _SUFFIXES:
        return _SUFFIXES[path.suffix.lower()]
    if path.suffix == ".json":
        from ..foundation.files import read_json

        content = read_json(path)
        known = {"measurement/1": "measurement", "recording/1": "recording"}
        if isinstance(content, dict) and content.get("format") in known:
            return known[content["format"]]
    remedy = f"Known suffixes: {', '.join(_SUFFIXES)}; or say what it is with --kind."
    raise InputError("be measured reflectance of a known kind", got=path.suffix or "no suffix", file=path, remedy=remedy)


def to_rgb(abrdf: ABRDF) -> ABRDF:
    """Return the same samples in linear Rec. 709: spectra are integrated, one channel is repeated.

    Colours outside the gamut come out negative in a channel, which no reflectance is: they are set to 0.
    """
    if abrdf.channels == ("R", "G", "B"):
        return abrdf
    wavelengths = wavelengths_of(abrdf.channels)
    if wavelengths is not None and len(wavelengths) == len(abrdf.channels) > 1:
        value = np.maximum(abrdf.value @ rgb_weights(wavelengths).astype(np.float32), 0)
    elif len(abrdf.channels) == 1:
        value = np.repeat(abrdf.value, 3, axis=-1)
    elif len(abrdf.channels) == 3:
        value = abrdf.value
    else:
        raise InputError("be RGB, one channel, or wavelengths", got=", ".join(abrdf.channels), key="channels")
    return replace(abrdf, value=value.astype(np.float32), channels=("R", "G", "B"))


def _of_abrdf(kind: str, abrdf: ABRDF, *notes: str) -> Source:
    said = []
    if abrdf.channels != ("R", "G", "B"):
        said.append(f"{len(abrdf.channels)} channels ({abrdf.channels[0]} to {abrdf.channels[-1]}) became linear Rec. 709.")
    flat = to_rgb(abrdf).normalise().flat()
    mask = abrdf.mask if abrdf.mask is not None else np.ones((1, flat.num_texels), bool)

    def block(first: int, last: int) -> ABRDF:
        return replace(flat, value=flat.value[first:last], valid=flat.valid[first:last], mask=None)

    return Source(kind, abrdf.name, mask, block, notes=(*notes, *said))


def _of_blocks(kind: str, name: str, mask: NDArray[np.bool_], block: Callable[[int, int], ABRDF], *notes: str) -> Source:
    return Source(kind, name, mask, lambda first, last: block(first, last).normalise(), notes=notes)


def _of_photographs(kind: str, photographs: Photographs) -> Source:
    source = _of_abrdf(kind, photographs.abrdf)
    return replace(source, photographs=photographs)
