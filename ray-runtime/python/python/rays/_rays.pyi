"""What is written in Rust; ``rays.Rig`` is its interface."""

from typing import List, Optional, Tuple

import numpy as np
from numpy.typing import NDArray

class Blob:
    def __new__(cls, bytes: bytes) -> "Blob": ...
    def cameras(self) -> List[Tuple[str, List[int], List[int], List[float], List[float], bool]]: ...
    def facts(self) -> Tuple[str, str, bytes, float, float, Optional[float]]: ...
    def uncertain_pairs(self) -> List[List[int]]: ...
    def self_test(self) -> Tuple[int, bool]: ...
    def rays(
        self, camera: int, uv: NDArray[np.floating]
    ) -> Tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.uint8]]: ...
    def triangulate(
        self,
        cameras: Tuple[int, int],
        uv_a: NDArray[np.floating],
        uv_b: NDArray[np.floating],
        depth: int,
        noise_px: Optional[float],
    ) -> Tuple[
        NDArray[np.float32],
        NDArray[np.float32],
        NDArray[np.uint8],
        Optional[NDArray[np.float32]],
        Optional[NDArray[np.float32]],
    ]: ...
    def project(
        self, camera: int, xyz: NDArray[np.floating], near: Optional[NDArray[np.floating]], follow: bool
    ) -> NDArray[np.float32]: ...
    def mask(self, camera: int) -> NDArray[np.bool_]: ...
