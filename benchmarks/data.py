"""Where measured data lie that do not come with the project."""

from __future__ import annotations

import os
from pathlib import Path

from .peers import PeerMissing

_CHECKOUT = Path(__file__).resolve().parent.parent


def data_folder() -> Path:
    """Return the folder that `MENISCUS_DATA` names, else `shared/data` beside the checkout.

    Raises
    ------
    PeerMissing
        If there is none.
    """
    folder = Path(os.environ.get("MENISCUS_DATA") or _CHECKOUT.parent / "shared" / "data")
    if not folder.is_dir():
        raise PeerMissing("the measured data are not here; set MENISCUS_DATA to their folder")
    return folder
