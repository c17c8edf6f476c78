"""The flow algorithms of OpenCV and its contributed modules, behind our interface.

Their thread pools and parameters are OpenCV's own; what an installed version lacks is not listed.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from .pictures import bytes_pair

Estimate = Callable[[NDArray, NDArray], NDArray[np.float32]]
_contrib = getattr(cv2, "optflow", None)


def dis(image0: NDArray, image1: NDArray) -> NDArray[np.float32]:
    """Return the flow of dense inverse search, preset "medium" with variational refinement (Kroeger et al. 2016)."""
    return _grey(cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM), image0, image1)


def farneback(image0: NDArray, image1: NDArray) -> NDArray[np.float32]:
    """Return the flow by polynomial expansion (Farnebäck 2003): 5 levels, window 15, Gaussian."""
    options = {"numLevels": 5, "pyrScale": 0.5, "winSize": 15, "numIters": 5, "polyN": 7, "polySigma": 1.5}
    return _grey(cv2.FarnebackOpticalFlow.create(**options, flags=cv2.OPTFLOW_FARNEBACK_GAUSSIAN), image0, image1)


def deepflow(image0: NDArray, image1: NDArray) -> NDArray[np.float32]:
    """Return the flow of DeepFlow's variational part; OpenCV's version has no deep matches (Weinzaepfel et al. 2013)."""
    return _grey(cv2.optflow.createOptFlow_DeepFlow(), image0, image1)


def dual_tvl1(image0: NDArray, image1: NDArray) -> NDArray[np.float32]:
    """Return the flow of dual TV-L1 (Zach et al. 2007)."""
    return _grey(cv2.optflow.createOptFlow_DualTVL1(), image0, image1)


def pcaflow(image0: NDArray, image1: NDArray) -> NDArray[np.float32]:
    """Return the flow of PCAFlow, a basis of smooth fields fitted to sparse matches (Wulff and Black 2015)."""
    return _grey(cv2.optflow.createOptFlow_PCAFlow(), image0, image1)


def simpleflow(image0: NDArray, image1: NDArray) -> NDArray[np.float32]:
    """Return the flow of SimpleFlow (Tao et al. 2012), with the parameters of OpenCV's example."""
    one, two = (image[..., ::-1].copy() for image in bytes_pair(image0, image1))
    return np.asarray(cv2.optflow.calcOpticalFlowSF(one, two, 3, 2, 4), np.float32)


def available() -> dict[str, Estimate]:
    """Return what the installed OpenCV has, by name."""
    found: dict[str, Estimate] = {}
    for name, function, needed, module in (
        ("dis", dis, "DISOpticalFlow", cv2),
        ("deepflow", deepflow, "createOptFlow_DeepFlow", _contrib),
        ("tvl1", dual_tvl1, "createOptFlow_DualTVL1", _contrib),
        ("farneback", farneback, "FarnebackOpticalFlow", cv2),
        ("pcaflow", pcaflow, "createOptFlow_PCAFlow", _contrib),
        ("simpleflow", simpleflow, "calcOpticalFlowSF", _contrib),
    ):
        if module is not None and hasattr(module, needed):
            found[name] = function
    return found


def _grey(algorithm, image0: NDArray, image1: NDArray) -> NDArray[np.float32]:
    one, two = (cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) for image in bytes_pair(image0, image1))
    return np.asarray(algorithm.calc(one, two, None), np.float32)
