"""Whether arrays read from a file are those of a table: their names, ranks and sizes, before anything is evaluated with them."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxframes.errors import TableError

Form = tuple[int | str, ...]
"""Size of each axis: a number, or a letter that stands for one number throughout a table."""
RECORDS: dict[str, Form] = {"rows": ("n", "width"), "grid": (3,)}
STARTS: dict[str, Form] = {"first": ("cells",), "ends": ("n", 2)}
"""What record tables have besides where their records are not as long as each other."""


def check_shapes(arrays: Mapping[str, np.ndarray], forms: Mapping[str, Form], sizes: dict[str, int], what: str) -> None:
    """Refuse arrays that have other names or shapes than they should (TableError).

    Args:
        arrays: The arrays by name.
        forms: The form of each.
        sizes: What letters stand for; those that are met are added.
        what: What has these arrays, for messages.
    """
    if set(arrays) != set(forms):
        raise TableError(f"{what} has the arrays {sorted(forms)}, found {sorted(arrays)}")
    for name, form in forms.items():
        shape = arrays[name].shape
        wanted = tuple(sizes.setdefault(n, size) if isinstance(n, str) else n for n, size in zip(form, shape, strict=False))
        if len(shape) != len(form) or shape != wanted:
            raise TableError(f"{what}: {name} has the shape {[sizes.get(str(n), n) for n in form]}, found {list(shape)}")


def check_records(arrays: Mapping[str, np.ndarray], series: Any, compares: Any, what: str) -> int:
    """Return how many records a record table has, refusing arrays that do not fit each other (TableError).

    Args:
        arrays: Its arrays by name.
        series: Series of coefficients in each row.
        compares: Most comparisons of a look-up.
        what: The table, for messages.
    """
    sizes: dict[str, int] = {}
    check_shapes(arrays, RECORDS | (STARTS if "first" in arrays else {}), sizes, what)
    terms = sizes["width"] - 3
    if type(series) is not int or series < 1 or terms < series or terms % series:
        raise TableError(f"{what}: rows of {sizes['width']} numbers hold no whole terms of {series!r} series, a middle and a half length")
    if type(compares) is not int or not 0 <= compares <= sizes["n"]:
        raise TableError(f"{what}: a look-up compares 0 to {sizes['n']} records, found {compares!r}")
    if not sizes["n"] or not np.isfinite(arrays["grid"]).all() or arrays["grid"][2] <= 0:
        raise TableError(f"{what}: it needs a record, and cells of a positive width; found {sizes['n']} and {arrays['grid'][2]}")
    if "first" in arrays:
        first = arrays["first"]
        if not first.size or not ((first >= 0) & (first < sizes["n"]) & (first == np.floor(first))).all():
            raise TableError(f"{what}: a cell starts in none of its {sizes['n']} records")
    return sizes["n"]
